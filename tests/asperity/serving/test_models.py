"""The models of the server: any scene, and any surrogate of it, against rows of its database."""

from pathlib import Path

import pytest
from databases import database_of
from learnt_rows import surrogate_of
from small_populations import POPULATIONS

from asperity.serving.models import Configuration, SolverModel, SurrogateModel, model_of
from gen.database import Reader
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.runtime.errors import InputError
from gen.scene import load
from learn import Surrogate

ROWS = (0, 1, 7, 40)
INPUTS = {  # sizes of the vectors: what is drawn, and the load
    "spectral": [2, 1],
    "python": [2, 1],
    "force": [1, 1],
    "scans": [1],
    "relative": [2, 1],
    "unsorted": [2, 1],
    "fixed": [1],
    "soft": [1, 1, 1],
}
MORE = {
    "unsorted": """
        samples = 60
        [surface]
        generator = "python"
        function = "small_populations:waves"
        nodes = 16
        parameters = { count = { choice = [4, 8] }, amplitude = [1.0, 3.0] }
        [load]
        quantity = "pressure"
        range = [0.001, 0.02]
    """,
    "fixed": """
        samples = 60
        [surface]
        nodes = 17
        hurst = 0.7
        sigma0 = 12.0
    """,
    "soft": """
        samples = 60
        [surface]
        nodes = 17
        hurst = 0.7
        sigma0 = { normal = [12.0, 1.0] }
        [contact]
        hardness = [0.01, 0.1]
    """,
}


@pytest.fixture(scope="module")
def folder(populations, tmp_path_factory):
    """Scenes, databases and surrogates of all populations."""
    more = tmp_path_factory.mktemp("models")
    for name, scene in MORE.items():
        database_of(more, scene, name)
    for name in POPULATIONS:
        for suffix in ("toml", "h5"):
            (more / f"{name}.{suffix}").symlink_to(populations / f"{name}.{suffix}")
    for name in INPUTS:
        surrogate_of(more / f"{name}.h5", "--target", "area", "--model", "kernel-ridge")
    return more


def asked(scene, columns, row, load):
    """The vectors of a row: what is drawn, and the load."""
    drawn = {
        "spectral": ("roll_off", "drawn_rms_slope"),
        "python": ("amplitude", "count"),
    }
    drawn |= {"unsorted": ("amplitude", "count")}
    drawn |= {
        "force": ("drawn_rms_height",),
        "relative": ("hurst", "sigma0"),
        "soft": ("sigma0",),
    }
    vectors = [[float(columns[name][row]) for name in drawn.get(scene, ())]]
    vectors = [vector for vector in vectors if vector] + [[float(load[row])]]
    return [*vectors, [float(columns["hardness"][row])]] if scene == "soft" else vectors


def columns_of(path):
    with Reader(path) as reader:
        return reader.scene, {
            column.name: reader.column(column.name) for column in reader.columns()
        }


@pytest.mark.few(3)
@pytest.mark.parametrize("name", INPUTS)
def test_the_solver_answers_with_rows_of_any_scene(folder, name, monkeypatch):
    monkeypatch.chdir(Path((folder / f"{name}.toml").resolve()).parent)
    model = SolverModel(load(f"{name}.toml"), name)
    assert model.input_sizes == INPUTS[name]
    scene, columns = columns_of(folder / f"{name}.h5")
    given = columns["delta" if scene.quantity == "delta" else "load"]
    for row in ROWS:
        config = Configuration(surface=int(columns["surface"][row]))
        answer = model.evaluate(asked(name, columns, row, given), config)
        assert answer == [
            [columns[key][row]] for key in ("area_percent", "force", "delta")
        ]


@pytest.mark.parametrize("name", ["python", "unsorted"])
def test_a_surrogate_runs_no_function_even_a_trusted_one(folder, name):
    with pytest.raises(
        InputError, match="small_populations:waves, and no code runs for a surr"
    ):
        model_of(str(folder / f"{name}.surrogate"))


@pytest.mark.parametrize("name", sorted(INPUTS.keys() - {"python", "unsorted"}))
def test_a_surrogate_of_any_scene_answers_as_it_predicts(folder, name):
    """At the Delta of a row where the scene gives pressures or forces."""
    model = model_of(str(folder / f"{name}.surrogate"))
    assert isinstance(model, SurrogateModel)
    assert model.input_sizes == INPUTS[name]
    surrogate = Surrogate.load(folder / f"{name}.surrogate")
    scene, columns = columns_of(folder / f"{name}.h5")
    given = columns["load" if scene.quantity == "delta/height_rms" else "delta"]
    for row in ROWS:
        config = Configuration(surface=int(columns["surface"][row]))
        ((value, low, high, inside),) = model.evaluate(
            asked(name, columns, row, given), config
        )
        heights = surface_of(scene, parameters(scene, row, row + 1), 0)
        hardness = float(columns["hardness"][row]) if name == "soft" else None
        delta = float(columns["delta"][row])
        wanted = surrogate.predict(heights, scene.sides, delta, hardness=hardness)
        assert value == pytest.approx(wanted.area[0], rel=1e-12)
        assert inside == wanted.inside[0]
        ends = [wanted.low["area"][0], wanted.high["area"][0]] if inside else [None, None]
        assert [low, high] == pytest.approx(ends)


def test_a_surrogate_is_asked_without_its_intervals(folder):
    """Two finite numbers a target, inside and outside, for clients that know no null."""
    model, config = (
        model_of(str(folder / "fixed.surrogate")),
        Configuration(interval=False),
    )
    assert (model.output_sizes(config), model.output_sizes(Configuration())) == ([2], [4])
    ((value, flag),) = model.evaluate([[1e5]], config)
    ((same, *ends, outside),) = model.evaluate([[1e5]], Configuration())
    assert (value, flag) == (same, outside)
    assert (ends, flag) == ([None, None], 0)


def test_windows_of_maps_keep_their_nodes(folder):
    model = model_of(str(folder / "scans.surrogate"))
    with pytest.raises(InputError, match=r"nodes: .*windows"):
        model.evaluate([[1.0]], Configuration(nodes=30))
