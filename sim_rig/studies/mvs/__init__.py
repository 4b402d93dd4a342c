"""Shared sensing among many cars: the MVS paper's figures and Table I, and what they rest on."""
