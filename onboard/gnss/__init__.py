"""Where the car is: from gpsd, or from a receiver's NMEA sentences directly.

`gpsd_reader` and `nmea` are the cores; `gpsd` is the wire.
"""
