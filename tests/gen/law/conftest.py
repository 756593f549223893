"""A surface without edges, and laws of it by the command line."""

import numpy as np
import pytest

from gen import cli
from gen.law import Order, by_solver

STEEL = ["--young", "210e3", "--poisson", "0.3"]


def waves(nodes, seed):
    """Return a sum of waves that repeats itself on nodes x nodes cells [um]."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(*[np.arange(nodes) / nodes * 2 * np.pi] * 2)
    return 0.3 * sum(
        np.cos(i * x + j * y + rng.uniform(0, 7)) / (i * i + j * j)
        for i in range(4)
        for j in range(4)
        if i + j
    )


@pytest.fixture
def surfaces(tmp_path, monkeypatch):
    """A folder of three surfaces, in the working directory."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "many").mkdir()
    for seed in range(3):
        np.save(tmp_path / f"many/s{seed}.npy", waves(20, seed))
    return tmp_path


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
