"""`onboard calibrate`: focal length, distortion and mounting of a camera."""
