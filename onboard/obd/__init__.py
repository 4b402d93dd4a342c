"""Speed, brake pedal and hard braking from the car's own bus.

Two sources: OBD-II service 01 asked for over ISO 15765-2, and signals that the car broadcasts,
named by a DBC file. `car_bus` is the core that holds it all; `can_bus` is the wire.
"""
