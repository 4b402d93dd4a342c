"""Rakhshan et al.: driver-based channel access on a highway."""
