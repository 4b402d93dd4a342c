"""The warning group (LCCA): which vehicles follow each other too closely, and who is warned.

`transitions` holds the rules, `group` one vehicle's part in them. The lead vehicle is identified by
its plate, never by a position. A member's *predecessor* is the lead vehicle that it follows.
"""
