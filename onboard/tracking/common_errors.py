"""What the measurements of one observer have in common: the error of its position.

A receiver is off by much the same vector for half a minute, longer than evidence is used. So the
filter, to which the errors of all measurements are independent, is too sure of a position. Where
n_k of n measurements are of an observer k whose position is off by s_k (one standard deviation),
the mean of all has the variance s_k^2 n_k^2 / n^2 of that error, of which the filter has
s_k^2 n_k / n^2.
"""

from collections import Counter
from collections.abc import Callable

from onboard.tracking.evidence import Provenance, observer_numbers_of, observer_with_number

ObserverSigma = Callable[[bytes], float]
"""Standard deviation of an observer's position on either axis, m, by its temporary ID."""


def common_variance_m2(provenance: Provenance, sigma_m: ObserverSigma) -> float:
    """Return the variance on either axis that the filter leaves out.

    Args:
        provenance: the measurements that were fused.
        sigma_m: of the position of each observer.
    """
    counts = Counter(observer_numbers_of(provenance))
    shared = sum(
        sigma_m(observer_with_number(number)) ** 2 * count * (count - 1)
        for number, count in counts.items()
        if count > 1
    )
    return shared / len(provenance) ** 2
