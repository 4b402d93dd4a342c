"""MVS: vehicles with a radio measure vehicles without, share the measurements, and fuse them.

After Gao, Liu, Dong: "A Multiple Vehicle Sensing Approach for Collision Avoidance in Progressively
Deployed Vehicle Networks". `multi_vehicle_sensing.py` is the sublayer; the tracker below it is
`onboard/tracking`. The paper's terms (direct measurement, estimate, significance, window, ME) are
used for the paper's things.
"""
