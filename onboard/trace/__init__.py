"""The trace: one JSON line per observation, transition, message and alarm."""
