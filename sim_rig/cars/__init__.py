"""Simulated devices of a car: ECU on the CAN bus, camera, vehicle detector, GNSS receiver."""
