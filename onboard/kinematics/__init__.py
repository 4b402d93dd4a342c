"""Geodesy, and the acceleration behind a series of speeds."""
