"""Plate, tag, lead car and distance from camera frames, tracked from frame to frame."""
