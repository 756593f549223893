"""The gallery's examples run as they stand, and find what their texts say; each pins one number."""

import runpy
from pathlib import Path

import numpy as np
import pytest

approx = pytest.approx
pytestmark = pytest.mark.long  # make docs runs the gallery too
FOLDER = Path(__file__).parents[1] / "examples" / "gallery"

CLAIMS = {
    "area": lambda it: (
        it["error"].resolved
        and it["areas"][0, 1, 1:] == approx(it["fine"].continuum_area_percent, rel=0.01)
        and it["areas"][0, 0, 3] > 1.05 * it["fine"].continuum_area_percent
        and it["areas"][1, 1, -1] < 0.6 * it["areas"][1, 1, 0]
    ),
    "hertz": lambda it: np.abs(it["force_error"]).max() < 1e-3,
    "scan_to_law": lambda it: (
        it["code"] == 0
        and (np.diff(it["closure"]) > 0).all()
        and it["area"][-1] == approx(50, abs=1)  # load / hardness
    ),
    "hardness": lambda it: (
        it["yielding"].largest_pressure == 2000
        and (it["areas"][2000.0] > 100 * it["pressures"] / 2000).all()
        and (it["areas"][None] < it["areas"][6000.0]).all()
    ),
    "unloading": lambda it: (it["yielded"][:, 0] > 0).all() and not it["yielded"][:5, 1].any(),
    "boundaries": lambda it: (
        it["border"].mean() == approx(0.18, abs=0.005)
        and it["shares"]["free"] > 1.5 * max(it["shares"][each] for each in ("periodic", "mirror"))
    ),
    "calculix": lambda it: (
        it["code"] == 0
        and {"PRESSURE-OVERCLOSURE=TABULAR", "*GAP CONDUCTANCE"}
        <= set("\n".join(it["lines"]).replace(", ", "\n").split("\n"))
        and (np.diff(it["laws"]["conductance_W_per_mm2_K"]) > 0).all()
        and is_on_the_law(it["laws"], *it["pressed"])
    ),
    "database": lambda it: len(it["done"]) == 200 and it["correlation"] > 0.9,
    "surrogate": lambda it: it["error"] < 0.05 and it["inside"] >= 0.7,
    "propagation": lambda it: it["areas"][:30].mean() == approx(np.mean(it["solved"]), rel=0.1),
    "sobol": lambda it: np.argmax(it["indices"]["ST"]) == 2,  # Delta
    "spots": lambda it: (
        it["light"].spots.gap_connects == (True, True)
        and it["heavy"].spots.gap_connects == (False, False)
    ),
    "spectrum": lambda it: it["hurst"] == approx(0.8, abs=0.01),
    "theory": lambda it: it["PERSSON"] < it["kappa"] < it["BUSH_GIBSON_THOMAS"],
    "refinement": lambda it: (
        (np.diff(it["elastic_area"]) < 0).all()
        and (it["yielding_area"] > 1).all()
        and it["elastic"][0].mean_gap == approx(it["elastic"][-1].mean_gap, rel=0.1)
    ),
}
"""What each example finds, by its names."""


def is_on_the_law(laws, closure=None, pressure=None):
    """Whether CalculiX, where it is installed, has found a pressure of the law."""
    if closure is None:
        return True
    return pressure == approx(
        np.interp(closure, laws["closure_um"], laws["pressure_MPa"]), rel=0.05
    )


def test_every_example_is_short_and_tested():
    found = {path.stem.removeprefix("plot_"): path for path in FOLDER.glob("plot_*.py")}
    assert found.keys() == CLAIMS.keys()
    assert all(len(path.read_text("utf-8").splitlines()) < 80 for path in found.values())


@pytest.mark.parametrize("name", CLAIMS)
def test_an_example_finds_what_it_says(name, monkeypatch):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    monkeypatch.setenv("MPLBACKEND", "agg")
    pyplot.switch_backend("agg")
    monkeypatch.setattr(pyplot, "show", lambda: None)
    monkeypatch.chdir(FOLDER)
    before = sorted(path.name for path in FOLDER.parent.iterdir())
    found = runpy.run_path(str(FOLDER / f"plot_{name}.py"))
    assert pyplot.get_fignums()
    pyplot.close("all")
    assert sorted(path.name for path in FOLDER.parent.iterdir()) == before
    assert CLAIMS[name](found), name
