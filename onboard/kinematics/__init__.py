"""Positions, headings and speeds of vehicles: frames, states as arrays, acceleration, heading."""
