"""Errors of the area by the nodes in a wave, and bars of them on surfaces of all kinds."""

import numpy as np
import pytest

from bench import grid_error, resolution


@pytest.fixture(scope="module")
def rows():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(resolution, "TRUTH", 32)
        return resolution.resolution(surfaces=2, finest=8)


def error(rows, way, nodes, pressure):
    (found,) = (
        row["area_error_percent"]
        for row in rows
        if (row["way"], row["nodes_a_wave"], row["pressure"]) == (way, nodes, pressure)
    )
    return float(found)


@pytest.mark.parametrize(
    ("nodes", "bounds"), [(4, (3.5, 1.4, 0.6, 0.4)), (8, (1.2, 0.6, 0.3, 0.15))]
)
def test_the_area_in_the_continuum_is_right(rows, nodes, bounds):
    for pressure, bound in zip(resolution.PRESSURES, bounds, strict=True):
        own = error(rows, resolution.CONTINUUM, nodes, pressure)
        assert own < bound
        assert own < error(rows, resolution.COUNT, nodes, pressure) / 5


def test_every_way_and_grid_has_a_row(rows):
    ways = {row["way"] for row in rows}
    others = {resolution.COUNT, resolution.TWO_GRIDS, *resolution.PERIMETER}
    assert ways == {resolution.CONTINUUM} | others
    assert all(row["seconds"] > 0 for row in rows)
    refined = [error(rows, resolution.COUNT, nodes, 0.2) for nodes in (2, 4, 8)]
    assert refined == sorted(refined, reverse=True)


@pytest.mark.parametrize("kind", grid_error.KINDS)
def test_samples_are_one_surface_on_two_grids(kind):
    sample = grid_error.KINDS[kind](np.random.default_rng(1))
    coarse, fine = sample.surface(sample.nodes), sample.surface(sample.exact)
    assert coarse.shape == (sample.nodes, sample.nodes)
    if sample.boundary == "mirror":  # whose nodes lie in the middle of cells
        assert np.ptp(fine) == pytest.approx(np.ptp(coarse), rel=0.2)
    else:
        assert fine[:: sample.finer, :: sample.finer] == pytest.approx(coarse, abs=1e-12)


@pytest.mark.long
def test_bars_are_judged_by_kind_and_in_all():
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
