"""MVS: cars with a radio measure cars without one, share what they see, and fuse what they get.

After Gao, Liu, Dong: "A Multiple Vehicle Sensing Approach for Collision Avoidance in Progressively
Deployed Vehicle Networks". Start at `multi_vehicle_sensing.py`; the paper's own words
(`direct measurement`, `estimate`, `significance`, `window`, `ME`) are used for the paper's things.
"""
