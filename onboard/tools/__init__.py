"""Commands for use outside the car: replay, export, decoding, calibration, keys."""
