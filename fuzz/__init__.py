"""Coverage-guided fuzzing of everything that reads bytes from outside: `make fuzz`.

`targets` declares each decoder and its exceptions; `corpus/<target>/` keeps useful inputs, which
the tests replay. `__main__` runs atheris on each target for a bounded time, then times the inputs.
"""
