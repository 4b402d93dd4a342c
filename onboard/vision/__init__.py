"""Detection of plates, tags and vehicles in camera frames, their tracks, and the lead."""
