"""Databases of finer grids that the report takes, and those that it refuses."""

import pytest

from bench import databases
from bench.paper import database
from gen.runtime.errors import InputError


def test_a_finer_grid_of_something_else_is_refused(tmp_path):
    text = "samples = 1\n[surface]\nnodes = 257\nhurst = [0.5, 0.6]\n"
    path = databases.generated(tmp_path, "other", text)
    with pytest.raises(InputError, match=r"another grid \(surface.hurst"):
        database.check(path)
