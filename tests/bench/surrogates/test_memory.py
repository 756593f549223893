"""The memory of fits: what is fitted, and that it stays below what is reckoned with."""

import pytest

from bench.surrogates.memory import GIB, LARGEST, TREES, memory
from gen.runtime.errors import InputError
from learn.comparison.paper import SPACES
from learn.models import needed_memory


def test_every_grid_has_a_candidate_that_takes_the_most():
    assert LARGEST.keys() == SPACES.keys()
    for model, settings in LARGEST.items():
        assert TREES not in settings
        for name in settings.keys() - {"max_iter", "gamma"}:
            assert settings[name] in SPACES[model][name], (model, name)


@pytest.mark.parametrize(
    ("models", "rows", "message"),
    [
        (["forest"], 500, "--model 'forest': give one of"),
        ([], 99, "--rows 99: give 100 or more"),
        (["gaussian-process"], 10_000_000, "take fewer with --train-rows"),
    ],
)
def test_what_cannot_be_measured_is_refused(models, rows, message):
    with pytest.raises(InputError, match=message):
        memory(models, rows)


@pytest.mark.long
def test_a_kernel_takes_its_matrix_and_less_than_is_reckoned_with():
    (row,) = memory(["kernel-ridge"], 3000)
    matrix = 8 * 3000**2 / GIB
    assert matrix < row["peak"] - row["before"]
    assert row["peak"] < row["reckoned"] == needed_memory("kernel-ridge", 3000) / GIB
