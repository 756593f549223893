"""Surfaces without edges, and laws of them by the command line and in Python."""

import contextlib
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from strict import json_of

from gen import cli
from gen.law import Order, by_solver
from tests.maps import waves

STEEL = ["--young", "210e3", "--poisson", "0.3"]


def write_surfaces(folder):
    """Write a folder of three surfaces."""
    (folder / "many").mkdir()
    for seed in range(3):
        np.save(folder / f"many/s{seed}.npy", waves(20, seed))


@pytest.fixture
def surfaces(here):
    """A folder of three surfaces, in the working directory."""
    write_surfaces(here)
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


@dataclass(frozen=True)
class Written:
    """The files of laws in a folder of their own, and what was printed."""

    folder: Path
    printed: str  # on standard output
    warned: str  # on standard error

    def table(self, name, against="pressure_MPa"):
        """Read one table of a law from its CSV."""
        rows = pd.read_csv(self.folder / name)
        return rows[rows.against == against].reset_index(drop=True)

    def text(self, name):
        """Read a file as text."""
        return (self.folder / name).read_text(encoding="utf-8")

    def document(self, name):
        """Read a JSON document."""
        return json_of(self.folder / name)

    def heights(self, name):
        """Read the heights of a surface [um]."""
        return np.load(self.folder / name)


@pytest.fixture(scope="module")
def write(tmp_path_factory):
    """Solve laws of steel, in a new folder with three surfaces of 100 um, once for a module."""

    def written(*commands, prepare=lambda: None):
        folder = tmp_path_factory.mktemp("law")
        write_surfaces(folder)
        printed, warned = io.StringIO(), io.StringIO()
        with (
            contextlib.chdir(folder),
            contextlib.redirect_stdout(printed),
            contextlib.redirect_stderr(warned),
        ):
            prepare()
            for arguments in commands:
                words = ["law", *map(str, arguments), "--side", "100", *STEEL]
                assert cli.main(words) == 0
        return Written(folder, printed.getvalue(), warned.getvalue())

    return written
