"""Records the steps of a `Stack`, and repeats them from a recording."""
