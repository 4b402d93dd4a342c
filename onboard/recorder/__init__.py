"""The black box: what came in and what was decided, on disk as MCAP, and its replay to the bit.

`Tap` stands around a car's cores and notes each call of their verbs; `BlackBox` writes the notes
from a thread of its own into a ring of segment files; `replay` makes the same calls again.
"""
