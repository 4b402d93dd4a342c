"""Installation on the car's computer (the box), and tests of the installed box."""
