"""`onboard doctor`: tests each connection of the vehicle, and advises what to do where one fails.

Each test opens the same socket, bus or camera as the daemon for some seconds.
"""
