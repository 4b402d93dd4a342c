"""How the plate networks come to be: render, train, score. `make train` does all of it.

Nothing here is needed in the car; it runs in an environment of its own (`requirements.lock`). No
photograph is ever trained on.
"""
