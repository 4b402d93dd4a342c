"""What is there on this box and what is missing, wire by wire, each with what to do about it.

Every examination opens the same edge that the daemon opens, looks for a few seconds, and closes it.
"""
