"""Reproduces the papers' tables and figures, one command each: `sim-rig study NAME`.

Each writes its table as CSV, its figure as PNG and its settings as YAML into one folder.
"""
