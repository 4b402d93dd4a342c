"""The other end of each wire of a car: its ECU on the CAN bus, its camera, its satellites."""
