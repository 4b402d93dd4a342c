"""Commands for the desk, apart from what drives: replay, export, decoding, calibration, keys."""
