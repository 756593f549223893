"""Splits by rows and by surfaces, and baselines on them."""

import numpy as np
import pytest

from bench.paper.nearest.baselines import baseline, divide
from bench.paper.nearest.population import Rows
from gen.runtime.errors import InputError
from gen.statistics import NAMES
from learn.metrics import scores
from learn.models import MODELS, pipeline

SURFACE = np.repeat(np.arange(40), 10)


def made(seed: int = 0) -> Rows:
    """Rows whose areas depend on the displacement and on something of the surface alone."""
    random = np.random.default_rng(seed)
    statistics = {name: random.uniform(1, 2, 40)[SURFACE] for name in NAMES}
    delta = random.uniform(5, 45, SURFACE.size)
    area = 0.1 * delta + random.uniform(0, 5, 40)[SURFACE]
    return Rows({"delta": delta, "area_percent": area, **statistics}, SURFACE)


def test_a_fifth_of_the_rows_tests() -> None:
    for split, shared in (("rows", True), ("surfaces", False)):
        train, test = divide(SURFACE, split)
        assert sorted([*train, *test]) == list(range(400))
        assert test.size == 80
        assert bool(set(SURFACE[train]) & set(SURFACE[test])) == shared
        assert np.abs(np.diff(SURFACE[train])).mean() > 5  # in random order
    assert divide(np.arange(15_878), "rows")[1].size == 3175


def test_other_splits_are_refused() -> None:
    with pytest.raises(InputError, match="give rows or surfaces"):
        divide(SURFACE, "tiles")
    with pytest.raises(InputError, match="too few to split"):
        divide(np.zeros(100, dtype=np.int64), "surfaces")


def test_rows_of_known_surfaces_are_easier() -> None:
    rows = made()
    assert (
        baseline("random-forest", rows, "rows").r2
        > 30 + baseline("random-forest", rows, "surfaces").r2
    )


def test_kernel_ridge_is_that_of_the_library() -> None:
    rows = made()
    train, test = divide(SURFACE, "rows")
    model = pipeline(MODELS["kernel-ridge"]).fit(rows.inputs[train], rows.target[train])
    wanted = scores(rows.target[test], model.predict(rows.inputs[test]))
    assert baseline("kernel-ridge", rows, "rows").nmse == pytest.approx(wanted.nmse, rel=1e-6)


def test_training_rows_can_be_fewer() -> None:
    rows = made()
    assert (
        baseline("decision-tree", rows, "rows", most=20).r2
        < baseline("decision-tree", rows, "rows").r2
    )
