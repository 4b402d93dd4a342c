"""Positions of the host vehicle: from gpsd, or from a receiver's NMEA sentences.

`gpsd_reader` and `nmea` are the cores; `gpsd` is the wire.
"""
