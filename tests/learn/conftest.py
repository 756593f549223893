"""Databases for the tests of learn: solved once, then copied and spoilt as a test needs."""

import shutil

import h5py
import numpy as np
import pytest

from gen import cli

SCENE = "samples = 90\n[surface]\nnodes = 33\n"


@pytest.fixture(scope="session")
def solved(tmp_path_factory):
    """The path of a database of 90 samples, one a surface."""
    folder = tmp_path_factory.mktemp("database")
    (folder / "scene.toml").write_text(SCENE)
    assert cli.main(["run", str(folder / "scene.toml"), "-o", str(folder / "solved.h5")]) == 0
    return folder / "solved.h5"


@pytest.fixture
def database(solved, tmp_path):
    """A copy that a test may change."""
    return shutil.copy(solved, tmp_path / "database.h5")


@pytest.fixture
def change(database):
    """Overwrite rows of a column of the copy: change(column, rows, values)."""

    def write(column, rows, values):
        with h5py.File(database, "r+") as file:
            content = file[column][:]
            content[rows] = values
            file[column][:] = content
        return database

    return write


@pytest.fixture(scope="session")
def samples():
    """Inputs (80, 6) and a smooth positive target (80,)."""
    inputs = np.random.default_rng(3).uniform(0.2, 1.0, (80, 6))
    return inputs, 1 + inputs[:, 0] ** 2 + np.sin(3 * inputs[:, 1]) * inputs[:, 2]
