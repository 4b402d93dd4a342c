"""The likeliest label sequences of a network with connectionist temporal classification (CTC).

Several views of one plate give each their own probability of each class in each column. The
probability of a sequence is the mean over the views of its probability in one view, which is the
sum over all paths that spell it (Graves et al. 2006, Connectionist temporal classification).

Prefix beam search (Hannun et al. 2014, First-pass large vocabulary continuous speech recognition
using bi-directional recurrent DNNs, algorithm 1) finds likely sequences; the forward recursion
(Graves et al. 2006, section 4.1) then gives the exact probability of each.
"""

import numpy as np
import numpy.typing as npt

Likely = npt.NDArray[np.float64]
"""(views, columns, classes) of probabilities; class 0 is the blank."""

BEAM = 64
"""Prefixes that are kept after each column."""
MIN_CLASS = 3e-3
"""Probability, in any view, from which a class may extend a prefix in a column."""
MIN_PREFIX = 1e-6
"""Probability, as a share of the likeliest prefix's, above which a prefix is kept."""
MAX_LENGTH = 12
"""Labels of a sequence: so many of 37 classes make one number of 64 bits."""


def likeliest_sequences(likely: Likely, count: int) -> list[tuple[tuple[int, ...], float]]:
    """The `count` likeliest sequences that the search finds, with their exact probabilities.

    The likeliest is first. There are fewer if all others are dropped.
    """
    sequences = _search(likely, count)
    probabilities = sequence_probabilities(sequences, likely)
    order = np.argsort(-probabilities, kind="stable")
    return [(sequences[at], float(probabilities[at])) for at in order]


def sequence_probabilities(
    sequences: list[tuple[int, ...]], likely: Likely
) -> npt.NDArray[np.float64]:
    """Exact probability of each sequence: the mean over the views, (sequences,)."""
    if not sequences:
        return np.zeros(0)
    lengths = np.array([len(sequence) for sequence in sequences])
    states = np.zeros((len(sequences), 2 * int(lengths.max()) + 1), np.int64)
    for row, sequence in enumerate(sequences):  # a blank before, between and after
        states[row, 1 : 2 * len(sequence) : 2] = sequence
    # From two states back: only to a label, and only from another one.
    may_skip = np.zeros(states.shape)
    may_skip[:, 3::2] = states[:, 3::2] != states[:, 1:-2:2]
    emitted = likely.transpose(1, 0, 2)[:, :, states]
    # Two states that nothing reaches come before the first.
    reached = np.zeros((len(likely), len(states), states.shape[1] + 2))
    here, one_back, two_back = reached[..., 2:], reached[..., 1:-1], reached[..., :-2]
    here[..., :2] = emitted[0, ..., :2]
    arriving = np.empty_like(here)
    for emitted_here in emitted[1:]:
        np.multiply(two_back, may_skip, out=arriving)
        arriving += one_back
        arriving += here
        np.multiply(arriving, emitted_here, out=here)
    rows = np.arange(len(sequences))
    ends = here[:, rows, 2 * lengths] + one_back[:, rows, 2 * lengths]
    return np.asarray(np.minimum(1.0, ends).mean(axis=0))


def _search(likely: Likely, count: int) -> list[tuple[int, ...]]:
    """At most `count` sequences by prefix beam search, the likeliest first.

    A prefix is a number whose digits, to the base of the count of classes, are its labels; prefixes
    are in order of these numbers. For each view and prefix there are two probabilities: of the
    paths that end in a blank, and of those that end in its last label.
    """
    views, _, classes = likely.shape
    may_start = likely.max(axis=0) >= MIN_CLASS
    may_start[:, 0] = False
    prefixes = np.zeros(1, np.int64)
    last = np.zeros(1, np.int64)
    in_blank, in_label = np.ones((views, 1)), np.zeros((views, 1))
    for column, may_start_here in zip(likely.transpose(1, 0, 2), may_start, strict=True):
        labels = may_start_here.nonzero()[0]
        either = in_blank + in_label
        old_blank, in_blank = in_blank, either * column[:, :1]
        in_label = in_label * column[:, last]
        if not len(labels):
            continue
        started = either[:, :, None] * column[:, None, labels]
        # A repeated label goes on; after a blank it is another one.
        repeated, again = (last[:, None] == labels).nonzero()
        started[:, repeated, again] = old_blank[:, repeated] * column[:, labels[again]]
        started[:, prefixes >= classes ** (MAX_LENGTH - 1)] = 0.0
        # A longer prefix that is there already gets its share.
        shorter = np.minimum(prefixes.searchsorted(prefixes // classes), len(prefixes) - 1)
        at = np.minimum(labels.searchsorted(last), len(labels) - 1)
        is_there = (prefixes[shorter] == prefixes // classes) & (labels[at] == last)
        shorter, at = shorter[is_there], at[is_there]
        in_label[:, is_there] += started[:, shorter, at]
        started[:, shorter, at] = 0.0
        started = started.reshape(views, -1)
        totals = np.concatenate([(in_blank + in_label).sum(axis=0), started.sum(axis=0)])
        kept = _likeliest(totals)
        old, new = kept[kept < len(prefixes)], kept[kept >= len(prefixes)] - len(prefixes)
        longer = prefixes[new // len(labels)] * classes + labels[new % len(labels)]
        in_label = np.concatenate([in_label[:, old], started[:, new]], axis=1)
        in_blank = np.concatenate([in_blank[:, old], np.zeros((views, len(new)))], axis=1)
        prefixes = np.concatenate([prefixes[old], longer])
        order = prefixes.argsort()
        prefixes, in_blank, in_label = prefixes[order], in_blank[:, order], in_label[:, order]
        last = prefixes % classes
    order = np.argsort(-(in_blank + in_label).sum(axis=0), kind="stable")[:count]
    return [_labels(int(prefix), classes) for prefix in prefixes[order]]


def _likeliest(totals: npt.NDArray[np.float64]) -> npt.NDArray[np.intp]:
    """Indices of the prefixes to keep."""
    kept = np.flatnonzero(totals > MIN_PREFIX * totals.max(initial=0.0))
    if len(kept) > BEAM:
        kept = kept[np.argpartition(-totals[kept], BEAM)[:BEAM]]
    return kept


def _labels(prefix: int, classes: int) -> tuple[int, ...]:
    labels = []
    while prefix:
        prefix, label = divmod(prefix, classes)
        labels.append(label)
    return tuple(reversed(labels))
