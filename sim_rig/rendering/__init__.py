"""What a camera in the car sees: plates, cars, road and light, drawn and never photographed.

The rig's camera shows these pictures to the daemons, and `training/` teaches the networks on them.
Every font is shipped, so that a picture is the same on every machine.
"""
