"""When to warn: FCW, EEBL, IMA and the warnings of the LCCA group; `monitor.py` runs them all.

Sources: Joerer et al., "A Vehicular Networking Perspective on Estimating Vehicle Collision
Probability at Intersections", for IMA; NHTSA's tests and FMVSS 127 for FCW; SAE J2945/1 for EEBL.
"""
