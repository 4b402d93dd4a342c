"""Renders the images of a car's camera: plates, cars, road and light.

The rig's camera shows these pictures to the daemons, and `training/` teaches the networks on them.
Every font is shipped, so that a picture is the same on every machine.
"""
