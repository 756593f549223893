"""The gallery's examples run as they stand, and find what their texts say; each pins one number."""

import runpy
from pathlib import Path

import numpy as np
import pytest

matplotlib = pytest.importorskip("matplotlib")
pytestmark = pytest.mark.long  # make docs runs the gallery too
FOLDER = Path(__file__).parents[1] / "examples" / "gallery"


@pytest.fixture
def example(monkeypatch):
    """Run an example, and return its names."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    monkeypatch.setenv("MPLBACKEND", "agg")
    pyplot.switch_backend("agg")
    monkeypatch.setattr(pyplot, "show", lambda: None)
    monkeypatch.chdir(FOLDER)

    def run(name):
        before = sorted(path.name for path in FOLDER.parent.iterdir())
        names = runpy.run_path(str(FOLDER / f"plot_{name}.py"))
        assert pyplot.get_fignums()
        pyplot.close("all")
        assert sorted(path.name for path in FOLDER.parent.iterdir()) == before
        return names

    return run


def test_every_example_is_short_and_tested():
    tests = {name.removeprefix("test_") for name in globals() if name.startswith("test_")}
    for path in FOLDER.glob("plot_*.py"):
        assert path.stem.removeprefix("plot_") in tests
        assert len(path.read_text(encoding="utf-8").splitlines()) < 80


def test_hertz(example):
    assert np.abs(example("hertz")["force_error"]).max() < 1e-3


def test_scan_to_law(example):
    names = example("scan_to_law")
    assert names["code"] == 0
    assert (np.diff(names["closure"]) > 0).all()
    assert names["area"][-1] == pytest.approx(50, abs=1)  # load / hardness


def test_hardness(example):
    names = example("hardness")
    assert names["yielding"].largest_pressure == 2000
    assert (names["areas"][2000.0] > 100 * names["pressures"] / 2000).all()
    assert (names["areas"][None] < names["areas"][6000.0]).all()


def test_unloading(example):
    yielded = example("unloading")["yielded"]
    assert (yielded[:, 0] > 0).all()
    assert not yielded[:5, 1].any()


def test_boundaries(example):
    names = example("boundaries")
    shares = names["shares"]
    assert names["border"].mean() == pytest.approx(0.18, abs=0.005)
    assert shares["free"] > 1.5 * max(shares["periodic"], shares["mirror"])


def test_calculix(example):
    names = example("calculix")
    assert names["code"] == 0
    text = "\n".join(names["lines"])
    assert "PRESSURE-OVERCLOSURE=TABULAR" in text
    assert "*GAP CONDUCTANCE" in text
    laws = names["laws"]
    assert (np.diff(laws["conductance_W_per_mm2_K"]) > 0).all()
    if names["pressed"]:
        closure, pressure = names["pressed"]
        assert pressure == pytest.approx(
            np.interp(closure, laws["closure_um"], laws["pressure_MPa"]), rel=0.05
        )


def test_database(example):
    pytest.importorskip("h5netcdf")
    names = example("database")
    assert len(names["done"]) == 200
    assert names["correlation"] > 0.9


def test_surrogate(example):
    names = example("surrogate")
    assert names["error"] < 0.05
    assert names["inside"] >= 0.7


def test_propagation(example):
    names = example("propagation")
    assert names["areas"][:30].mean() == pytest.approx(np.mean(names["solved"]), rel=0.1)


def test_sobol(example):
    pytest.importorskip("SALib")
    indices = example("sobol")["indices"]
    assert np.argmax(indices["ST"]) == 2  # Delta


def test_spots(example):
    names = example("spots")
    assert names["light"].spots.gap_connects == (True, True)
    assert names["heavy"].spots.gap_connects == (False, False)


def test_spectrum(example):
    assert example("spectrum")["hurst"] == pytest.approx(0.8, abs=0.01)


def test_theory(example):
    names = example("theory")
    assert names["PERSSON"] < names["kappa"] < names["BUSH_GIBSON_THOMAS"]


def test_refinement(example):
    names = example("refinement")
    assert (np.diff(names["elastic_area"]) < 0).all()
    assert (names["yielding_area"] > 1).all()
    gaps = [contact.mean_gap for contact in names["elastic"]]
    assert max(gaps) / min(gaps) < 1.1
