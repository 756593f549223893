"""A surrogate as numbers, by which two files are compared."""

from pathlib import Path

import numpy as np

from learn import Surrogate


def numbers_of(path: Path | str) -> str:
    """Training ranges, and predictions with their intervals at places between their ends."""
    found = Surrogate.load(path)
    shares = np.random.default_rng(0).uniform(-0.2, 1.2, (50, found.low.size))
    inputs = found.low + shares * (found.high - found.low)
    numbers = [found.low, found.high, found.distance.of(inputs)]
    for learnt in found.learnt.values():
        raw = learnt.raw(inputs)
        numbers += [raw, *learnt.ends(inputs, raw, 0.5)]
    return repr([each.tolist() for each in numbers])
