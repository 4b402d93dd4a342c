"""Detections from a detector program of the user's, which sees vehicles on every side."""
