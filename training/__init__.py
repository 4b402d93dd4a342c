"""Training runs of the camera's networks: render, train, export, score. `make train` does all.

The car needs none of it; it runs in an environment of its own (`requirements.lock`). No photograph
is used for training.
"""
