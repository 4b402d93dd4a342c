"""The warning group (LCCA): who follows whom too closely, and who is warned when one brakes.

`transitions` holds the rules, `group` the car's part in them. The car ahead is known by its plate,
never by a position.
"""
