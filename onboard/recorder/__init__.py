"""The black box: inputs and outputs of the cores, recorded as MCAP for an exact replay.

`Tap` records each step of the cores; `BlackBox` writes the records from its own thread into segment
files of limited age and total size; `onboard.replay` repeats the steps.
"""
