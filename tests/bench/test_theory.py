"""The reports on theories and on grids: what their rows hold."""

import numpy as np
import pytest

from bem.analytic import BUSH_GIBSON_THOMAS, PERSSON
from bench import theory
from bench.growth import HARDNESSES, cost, growth, pressures
from gen.runtime.errors import InputError


def test_forces_of_the_papers_example():
    """At Delta = 1, the last of each; other numbers mean that solver or kernels have changed."""
    rows = theory.hertz(steps=2)
    forces = {(row["solution"], row["nodes"]): row["force_uN"] for row in rows}
    exact = 4 / 3 * np.sqrt(5000)
    assert forces["hertz", ""] == pytest.approx(exact, rel=1e-14)
    shares = {
        ("uniform-pressure", 128): 1.0011112,
        ("uniform-pressure", 256): 1.0002409,
        ("concentrated-force", 128): 1.0268076,
        ("concentrated-force", 256): 1.0129298,
    }
    for key, share in shares.items():
        assert forces[key] / exact == pytest.approx(share, abs=1e-6)


@pytest.fixture(scope="module")
def rows():
    return theory.theory(128, surfaces=1).tables["theory"]


def column(rows, name):
    """One value for each spectrum and load, (spectra, loads)."""
    return np.array([row[name] for row in rows]).reshape(len(theory.SPECTRA), -1)


def test_areas_lie_between_the_theories(rows):
    """Of medium loads; on a grid the areas of light loads are a few nodes."""
    pressure, area = column(rows, "pressure"), column(rows, "corrected_percent")
    assert (area < column(rows, "area_percent")).all()
    assert (np.diff(area, axis=1) > 0).all()
    medium = slice(4, 9)
    slopes = (area / 100 / pressure)[:, medium]
    assert (slopes > PERSSON).all()
    assert (slopes < BUSH_GIBSON_THOMAS).all()
    assert area[:, -1] == pytest.approx(column(rows, "persson_percent")[:, -1], rel=0.03)


def test_gaps_and_stiffness_are_those_of_perssons_relation(rows):
    """To 10 % where a patch holds many waves, which are those of the narrow band."""
    narrow, medium = 0, slice(3, 10)
    for name in ("mean_gap", "stiffness"):
        computed = column(rows, name)[narrow, medium]
        expected = column(rows, f"persson_{name}")[narrow, medium]
        assert computed == pytest.approx(expected, rel=0.1)


def test_yielding_spots_conduct_as_cooper_mikic_and_yovanovich_say():
    """With the exponent 0.95, on surfaces of many waves of one length."""
    spectrum = theory.SelfAffineSpectrum(0.8, 8 / 256, 8 / 256)
    found = theory.conductance(
        [theory.random_surface(spectrum, 256, seed) for seed in range(3)]
    )
    assert found[0]["exponent"] == pytest.approx(0.95, abs=0.02)
    ratios = [row["conductance"] / row["cooper_mikic_yovanovich"] for row in found]
    assert ratios == pytest.approx([1] * len(found), abs=0.15)


def test_rows_reach_their_contact_and_say_what_it_took():
    costs = cost((65, 129), surfaces=1, percents=(5.0,))
    assert [row["nodes"] for row in costs] == [65, 129]
    for row in costs:
        assert row["area_percent"] == pytest.approx(5, rel=0.2)
        assert row["convolutions"] >= 3
        assert row["seconds"] > 0
        assert row["padded_arrays"] > 0
    # Of the finer grid, whose arrays are larger than what else a process may take meanwhile.
    assert costs[-1]["padded_arrays"] < 6
    assert costs[0]["growth"] == 1
    ratio = costs[1]["convolutions"] / costs[0]["convolutions"]
    assert costs[1]["growth"] == pytest.approx(ratio)


def test_a_hardness_bounds_the_mean_pressure():
    pressed = pressures((65, 129), 1)
    assert [row["hardness"] for row in pressed] == [
        each for each in HARDNESSES for _ in range(2)
    ]
    elastic = pressed[:2]
    assert elastic[0]["area_percent"] > elastic[1]["area_percent"]
    for row in pressed[2:]:
        assert row["mean_pressure"] <= row["hardness"] * (1 + 1e-12)
        assert 0 < row["yielded_percent"] <= row["area_percent"]
        assert row["area_percent"] >= min(each["area_percent"] for each in elastic)


@pytest.mark.parametrize("nodes", [100, 33])
def test_grids_that_cannot_be_nested_are_refused(nodes):
    with pytest.raises(InputError, match=f"nodes {nodes}: give 2"):
        growth((nodes,), 1)
