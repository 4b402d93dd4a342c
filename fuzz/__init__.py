"""Coverage-guided fuzzing of everything that reads bytes from outside: `make fuzz`.

`targets` says what is fed and which exceptions are declared; `corpus/<target>/` keeps inputs worth
having, and the tests replay them. `__main__` runs atheris on each target for a bounded time, then
times what was found.
"""
