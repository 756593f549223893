"""Surfaces without edges, and laws of them by the command line and in Python."""

import numpy as np
import pytest

from gen import cli
from gen.law import Order, by_solver
from tests.maps import waves

STEEL = ["--young", "210e3", "--poisson", "0.3"]


@pytest.fixture
def surfaces(here):
    """A folder of three surfaces, in the working directory."""
    (here / "many").mkdir()
    for seed in range(3):
        np.save(here / f"many/s{seed}.npy", waves(20, seed))
    return here


@pytest.fixture
def run():
    """Run `gen law` on surfaces of 100 um with the constants of steel."""

    def called(*arguments, ends=0):
        words = ["law", *map(str, arguments), "--side", "100", *STEEL]
        assert cli.main(words) == ends

    return called


@pytest.fixture
def make():
    """Make a law in Python."""

    def made(*inputs, **order):
        return by_solver(Order(inputs=inputs, **order))

    return made
