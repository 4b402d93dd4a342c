"""Signalised intersections: which lane leads a vehicle to which signal, and what that shows.

`intersections.py` is the core; it takes MAP and SPAT messages (SAE J2735) of road-side units.
"""
