"""Where the seed of each new pseudonym comes from."""

import secrets
from collections.abc import Callable
from functools import partial

import numpy as np

from onboard.security.pseudonyms import ENTROPY_BYTES, FreshEntropy

_STREAM = 1


def entropy_source(seed: int | None) -> FreshEntropy:
    """Return a source of secret octets; with the seed of a test, of the same ones at each start.

    So a vehicle that is started again with a seed draws the same numbers after a change of its
    pseudonym, whatever it has drawn before.
    """
    octets: Callable[[int], bytes] = secrets.token_bytes
    if seed is not None:
        octets = np.random.default_rng([seed, _STREAM]).bytes
    return partial(octets, ENTROPY_BYTES)
