"""The road side: a signal controller, and the road-side unit that sends MAP and SPAT messages."""
