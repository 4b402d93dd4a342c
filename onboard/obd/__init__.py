"""Speed, brake pedal and hard braking from the vehicle's CAN bus.

Two sources: OBD-II service 01 over ISO 15765-2, and signals that the vehicle broadcasts, named by a
DBC file. `vehicle_bus` is the core; `can_bus` is the wire; `request_scheduler` decides when to send
requests, and what to do about unanswered ones.
"""
