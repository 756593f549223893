"""Bars of the grid's error, judged on surfaces of all kinds."""

import numpy as np
import pytest

from bench import grid_error


@pytest.mark.parametrize("kind", grid_error.KINDS)
def test_samples_are_one_surface_on_two_grids(kind: str) -> None:
    sample = grid_error.KINDS[kind](np.random.default_rng(1))
    coarse, fine = sample.surface(sample.nodes), sample.surface(sample.exact)
    assert coarse.shape == (sample.nodes, sample.nodes)
    if sample.boundary == "mirror":  # whose nodes lie in the middle of cells
        assert np.ptp(fine) == pytest.approx(np.ptp(coarse), rel=0.2)
    else:
        assert fine[:: sample.finer, :: sample.finer] == pytest.approx(coarse, abs=1e-12)


def test_bars_are_judged_by_kind_and_in_all() -> None:
    with pytest.MonkeyPatch.context() as patch:
        kept = {name: grid_error.KINDS[name] for name in ("sphere", "fractal")}
        patch.setattr(grid_error, "KINDS", kept)
        patch.setattr(grid_error, "FINEST", 300)
        rows = grid_error.grid_error(surfaces=2)
    assert [row["kind"] for row in rows] == [*kept, "all"]
    sphere, fractal, both = rows
    assert fractal["resolved_percent"] == 0
    assert fractal["area_percent_inside_percent"] == ""
    assert sphere["resolved_percent"] == 100
    assert sphere["area_percent_inside_percent"] >= 80
    assert both["contacts"] == sphere["contacts"] + fractal["contacts"]
