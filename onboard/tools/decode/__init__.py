"""`onboard decode`: the radio messages of a capture, one JSON object a line."""
