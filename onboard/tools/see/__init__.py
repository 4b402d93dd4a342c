"""`onboard see`: what the camera's code finds in pictures and videos, and how right it is."""
