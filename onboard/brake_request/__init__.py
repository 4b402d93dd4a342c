"""Requests to brake, for a test vehicle's own controller; off by default.

`brake_requester.py` decides, `datagram.py` and `dbc_frame.py` encode, `request_outputs.py` sends.
"""
