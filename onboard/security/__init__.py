"""IEEE 1609.2 signed data, the pseudonyms that a car signs with, and its own keys.

Nothing that came by radio is believed before `Security.open` has looked at it. Plates never
travel: `PlateDigest` turns one into the identity that LCCA messages carry.
"""
