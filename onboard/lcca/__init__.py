"""The warning group (LCCA): which vehicles follow each other too closely, and who is warned.

`transitions` holds the rules, `group` one vehicle's part in them. The preceding vehicle is
identified by its plate, never by a position.
"""
