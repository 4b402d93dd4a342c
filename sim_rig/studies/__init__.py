"""The papers' tables and figures again, one command each: `sim-rig study NAME`.

Each writes its numbers as CSV, its picture as PNG and its settings as YAML into one folder.
"""
