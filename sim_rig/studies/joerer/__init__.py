"""Joerer et al.: collision probability at intersections."""
