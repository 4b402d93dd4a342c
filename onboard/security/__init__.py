"""IEEE 1609.2 signed data, the pseudonyms that a car signs with, and misbehaviour detection.

A received message is used only after `SecurityServices.open` has accepted it. Plates are never
sent: `PlateDigest` derives the communication ID that LCCA messages carry instead.
"""
