"""Multi-target tracking: from measurements and estimates of vehicles to tracks.

`tracks.py` is the tracker. `association.py` assigns evidence to tracks within `gates.py`,
`fusion.py` estimates each track from its independent evidence, `track_merging.py` merges tracks of
one vehicle. `assignment.py` is the assignment algorithm alone, which the camera's tracker uses too.
"""
