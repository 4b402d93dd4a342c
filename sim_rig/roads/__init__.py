"""Motion of the cars: on a scenario's roads (`road.py`), or of many cars on a plane.

On the plane, every source (`sources.py`) has one method, `cars_at(at_s) -> Cars`.
"""
