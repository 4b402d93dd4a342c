"""The engineer's page of a live run: all cars side by side, and all they said, at any moment.

`story.py` and `album.py` are the cores: what the traces tell and what the cameras took, kept so
that any moment can be looked at again. `server.py` is the edge, a process of its own; `window.py`
is its end at the rig.
"""
