"""The radio: a unit at the end of each car's UDP wire, and the air between the units."""
