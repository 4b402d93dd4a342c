"""How the car gets onto a box, and the box tested as a whole."""
