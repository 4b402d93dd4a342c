"""When to warn: how likely a crash at a crossing is, how short the gap ahead is, who brakes.

Sources: Joerer et al., "A Vehicular Networking Perspective on Estimating Vehicle Collision
Probability at Intersections", for crossing paths; NHTSA and FMVSS 127 for the car ahead.
"""
