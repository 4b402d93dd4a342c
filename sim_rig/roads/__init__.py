"""Who drives where: on one road as a scenario says (`road.py`), or on a plane with many cars.

On the plane every source (`sources.py`) answers one question, `cars_at(at_s) -> Cars`.
"""
