"""One population of surfaces stands for the databases of many scenes."""

from pathlib import Path

import numpy as np
import pytest

import bem
from bench.paper.nearest import population as populations
from bench.paper.nearest.population import (
    Population,
    TooFew,
    nearest_places,
    population,
    rows_of,
)
from gen.generation.plan import surface_random
from gen.populations import surface_heights
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.statistics import NAMES, describe

FEW = "samples = 12\nsamples_per_surface = 3\n[contact]\nkernel = 'concentrated-force'\n"


@pytest.fixture(scope="module")
def surfaces(tmp_path_factory: pytest.TempPathFactory) -> Population:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(populations, "CHUNK", 4)
        return population(tmp_path_factory.mktemp("surfaces"), "concentrated-force", 4)


def test_surfaces_are_made_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(populations, "CHUNK", 1)
    monkeypatch.setattr(populations, "RATIOS", np.array([0.25, 0.5]))
    made = population(tmp_path, "concentrated-force", 2)
    monkeypatch.setattr(populations, "_surface", None)
    again = population(tmp_path, "concentrated-force", 2)
    assert made.areas.tobytes() == again.areas.tobytes()
    assert (np.diff(made.areas) >= 0).all()


@pytest.mark.parametrize("kind", ["text", "array", "other arrays", "cut off"])
def test_files_of_strangers_are_refused(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "concentrated-force-00000.npz"
    np.savez(
        path, hurst=np.zeros(2), **({"statistics": 1, "areas": 1} if kind == "cut off" else {})
    )
    if kind == "cut off":
        path.write_bytes(path.read_bytes()[:-9])
    elif kind == "text":
        path.write_text("hello")
    elif kind == "array":
        with path.open("wb") as file:
            np.save(file, np.zeros(2))
    with pytest.raises(InputError, match=r"00000.npz is not what this command keeps there"):
        population(tmp_path, "concentrated-force", populations.CHUNK)


def test_rows_are_those_of_the_surfaces_pressed_at_their_own_heights(
    surfaces: Population, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(populations, "APART", 1.0)
    scene = Scene.parse(FEW, "few")
    rows = rows_of(scene, surfaces)
    assert rows.target.size > 6
    for row in range(rows.target.size):
        (number,) = np.flatnonzero(surfaces.hurst == rows.columns["hurst"][row])
        unit = surface_heights(
            Scene.parse("samples = 1", "unit"),
            int(number),
            {"hurst": float(surfaces.hurst[number]), "sigma0": 1.0},
            surface_random(scene, int(number)),
        )
        heights = unit * rows.columns["height_max"][row] / unit.max()
        values = describe(heights, scene.spacing).values
        assert [rows.columns[name][row] for name in NAMES] == pytest.approx(
            [values[name] for name in NAMES], rel=1e-9
        )
        delta = rows.columns["delta"][row]
        contact = bem.solve(heights, 1000.0, delta, kernel="concentrated-force")
        assert rows.target[row] == pytest.approx(contact.area_percent, rel=0.05, abs=0.05)
    assert rows.inputs.shape == (rows.target.size, 23)


def test_a_population_that_is_too_small_is_refused(
    surfaces: Population, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(TooFew, match="5 surfaces: the population has 4"):
        rows_of(Scene.parse(FEW.replace("12", "13"), "more"), surfaces)
    with pytest.raises(TooFew, match="too few with their H"):
        rows_of(Scene.parse(FEW, "few"), surfaces)
    monkeypatch.setattr(populations, "APART", 1.0)
    shallow = FEW.replace("[contact]", "[surface]\nsigma0 = 90.0\n[contact]")
    with pytest.raises(InputError, match=r"sigma0: 0\.25 at least"):
        rows_of(Scene.parse(shallow, "shallow"), surfaces)


def test_places_are_near_and_none_is_taken_twice() -> None:
    random = np.random.default_rng(3)
    available, wanted = random.random(400), random.random(100)
    places = nearest_places(wanted, available)
    assert np.unique(places).size == 100
    assert np.abs(available[places] - wanted).max() < 0.03
    many = nearest_places(np.full(100, 0.5), available)
    assert np.unique(many).size == 100
    assert np.median(available[many]) == pytest.approx(0.5, abs=0.01)
    assert sorted(nearest_places(available, available)) == list(range(400))
