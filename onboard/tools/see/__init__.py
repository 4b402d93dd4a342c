"""`onboard see`: perception of images and videos, and its scores."""
