"""Road scenes with solid vehicles, drawn at random, to train and test the vehicle detector on.

Nothing in them is a photograph. They vary more than roads do, so that photographs fall inside.
"""
