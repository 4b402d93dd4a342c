"""Cars of a live run that are hardware: their wires, keys, clock and recording."""
