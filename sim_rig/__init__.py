"""The other end of the car's wires: ECU, camera picture, satellites, radio, other cars, road."""
