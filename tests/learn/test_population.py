"""The mean of a population: what it finds, how sure it is, and how a surrogate answers by it."""

import csv

import numpy as np
import pytest
from databases import database_of
from learnt_rows import surrogate_of

from asperity.serving.models import Configuration, SurrogateModel
from gen.runtime.errors import InputError
from learn import Surrogate
from learn import cli as learn_cli
from learn.comparison.folder import Folder
from learn.population import (
    Equations,
    Population,
    ScatterCorrelation,
    Whitened,
    _error_factor,
)


def test_the_mean_is_found_within_its_error_and_surfaces_scatter_about_it():
    """Rows of a surface share its scatter: three of them tell hardly more of the mean than one."""
    inside = []
    for seed in range(3):
        random = np.random.default_rng(seed)
        surfaces = np.repeat(np.arange(200), 3)
        X = np.column_stack(
            [random.normal(size=200)[surfaces], random.uniform(-1.7, 1.7, 600)]
        )
        mean = np.exp(X[:, 1]) * (2.0 + np.sin(X[:, 0]))
        y = mean * (1.0 + 0.1 * random.normal(size=200)[surfaces])
        found = Population().fit(X, y, surfaces)
        wrong = np.abs(found.predict(X) - mean)
        assert wrong.mean() < 0.03 * mean.mean()
        inside.append(np.mean(wrong < 1.645 * found.error(X)))
        scatter = np.abs(y - mean).mean()
        assert np.abs(found.left_out_ - y).mean() == pytest.approx(scatter, rel=0.2)
    assert 0.85 < np.mean(inside) < 0.98


def test_the_evidence_has_the_slopes_of_its_differences():
    random = np.random.default_rng(0)
    X, reach = random.normal(size=(60, 2)), 1 + random.random(60)
    blocks = [np.arange(60).reshape(20, 3)]
    rows = Whitened(
        X, random.normal(size=60), reach, blocks, ScatterCorrelation(0.2, 1.5)
    )
    at, step = np.log([1.0, 2.0, 0.5]), 1e-5 * np.eye(3)
    ends = [
        [rows.minus_log_evidence(at + sign * each, X[:20])[0] for sign in (1, -1)]
        for each in step
    ]
    slopes = (np.array(ends) @ [1, -1]) / 2e-5
    assert rows.minus_log_evidence(at, X[:20])[1] == pytest.approx(slopes, rel=1e-5)


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", [2, 6, 9])
def test_a_target_over_many_decades_leaves_equations_that_can_be_solved(seed):
    """Rounding made them indefinite where the scatter is far below what the process reaches."""
    random = np.random.default_rng(seed)
    inputs = random.standard_normal((600, 3))
    mean = np.exp(3 * inputs @ [1.0, 1.0, 2.0])
    found = Population().fit(inputs, mean * (1 + 0.3 * random.standard_normal(600) ** 2))
    assert np.corrcoef(found.predict(inputs), mean)[0, 1] > 0.9
    assert np.isfinite(found.error(inputs)).all()


@pytest.mark.parametrize(("apart", "low", "high"), [(0.0, 1.15, 1.3), (0.2, 1.4, 4.0)])
def test_halves_that_disagree_make_errors_of_means_larger(apart, low, high):
    """The rows leave coefficients with errors of 0.07; those of both halves differ by `apart`."""
    random = np.random.default_rng(2)
    seen = random.normal(size=(400, 20))
    half = np.arange(400) < 200
    first, second = apart * random.normal(size=(2, 20))
    unit = np.where(half, seen @ first, seen @ second) + random.normal(size=400)
    equations = Equations(seen, unit, seen.T @ seen, seen.T @ unit, np.eye(20))
    assert low <= _error_factor(equations, half) <= high


SCENE = """
samples = 240
samples_per_surface = 2
[surface]
generator = "spectral"
nodes = 16
side = 160.0
hurst = [0.5, 0.9]
rms_height = [0.5, 3.0]
roll_off = 100.0
cut_off = 40.0
[load]
quantity = "pressure"
range = { log_uniform = [0.001, 0.1] }
[contact]
boundary = "periodic"
"""


NUMBERS = {"hurst": 0.7, "rms_height": 1.2, "pressure": [0.002, 0.02, 0.2]}
"""Numbers that the surrogate is asked for; the third pressure is outside of its training."""

AT = ["--at", "hurst=0.7, rms_height=1.2"]
OUTSIDE = "pressure 0.2 outside 0.001 to 0.1"


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """The path of a surrogate of a scene by pressure."""
    database = database_of(tmp_path_factory.mktemp("by-pressure"), SCENE)
    return surrogate_of(database, "--features", "scene")


@pytest.fixture(scope="module")
def surrogate(path):
    return Surrogate.load(path)


@pytest.fixture(scope="module")
def new(surrogate):
    """Answers for a new surface."""
    return surrogate.predict(**NUMBERS)


@pytest.fixture(scope="module")
def mean(surrogate):
    """Answers for the mean over all surfaces."""
    return surrogate.predict(**NUMBERS, mean=True)


def csv_rows(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def column(rows, name):
    return [float(row[name]) for row in rows]


def predicted(path, tmp_path, *arguments):
    """Rows of the table that `learn predict` writes."""
    answers = tmp_path / "answers.csv"
    assert learn_cli.main(["predict", str(path), "-o", str(answers), *arguments]) == 0
    return csv_rows(answers)


def test_a_scene_by_pressure_is_learnt_by_its_numbers(surrogate, new):
    assert surrogate.features.names == ("hurst", "rms_height", "pressure")
    assert new.values.keys() == {"area", "delta"}
    assert (np.diff(new.area) > 0).all()


def test_intervals_do_not_reach_below_first_touch(surrogate):
    near = {"hurst": 0.5, "rms_height": 0.5, "pressure": 0.001}
    assert (surrogate.predict(**near, level=0.97).low["delta"] >= 0).all()


def test_the_mean_is_more_certain_than_a_new_surface(new, mean):
    of_mean, of_new = (each.high["area"] - each.low["area"] for each in (mean, new))
    assert (of_mean < of_new)[:2].all()


def test_a_number_outside_of_the_scene_is_named(new):
    assert new.reasons == ("", "", OUTSIDE)


def test_numbers_that_lack_and_surfaces_are_refused(surrogate):
    with pytest.raises(InputError, match="rms_height not given"):
        surrogate.predict(hurst=0.7, pressure=0.01)
    with pytest.raises(
        InputError, match="asks for hurst, rms_height, pressure, not for a surface"
    ):
        surrogate.predict(np.eye(16), 160.0, 1.0)


def test_the_command_line_answers_for_a_new_surface(path, new, tmp_path):
    rows = predicted(path, tmp_path, *AT, "--pressure", "0.002,0.02,0.2")
    assert column(rows, "pressure_MPa") == [0.002, 0.02, 0.2]
    assert column(rows, "area_percent") == pytest.approx(new.area)
    assert rows[0]["area_percent_low"] != ""
    assert rows[2]["area_percent_low"] == ""


def test_the_command_line_answers_for_the_mean(path, mean, tmp_path):
    rows = predicted(path, tmp_path, *AT, "--pressure", "0.002,0.02,0.2", "--mean")
    assert column(rows, "area_percent") == pytest.approx(mean.area)
    assert float(rows[0]["area_percent_low"]) == pytest.approx(mean.low["area"][0])


def test_the_command_line_answers_for_a_table_of_numbers(path, new, tmp_path):
    table = tmp_path / "asked.csv"
    table.write_text("part,hurst,rms_height\nseat,0.6,1.0\nseal,0.7,1.2\n")
    rows = predicted(path, tmp_path, str(table), "--pressure", "0.002,0.02")
    assert column(rows, "hurst") == [0.6, 0.6, 0.7, 0.7]
    assert [row["part"] for row in rows] == ["seat", "seat", "seal", "seal"]
    assert column(rows, "area_percent")[2:] == pytest.approx(new.area[:2])


def test_tables_with_different_further_columns_are_answered_together(path, tmp_path):
    columns = {"seat": "part", "seal": "maker"}
    for name, column_name in columns.items():
        table = tmp_path / f"{name}.csv"
        table.write_text(f"{column_name},hurst,rms_height\n{name}-1,0.7,1.2\n")
    bare = tmp_path / "bare.csv"
    bare.write_text("hurst,rms_height\n0.7,1.2\n")
    tables = [str(tmp_path / "seat.csv"), str(tmp_path / "seal.csv"), str(bare)]
    rows = predicted(path, tmp_path, *tables, "--pressure", "0.02")
    assert [row["part"] for row in rows] == ["seat-1", "", ""]
    assert [row["maker"] for row in rows] == ["", "seal-1", ""]


def test_a_law_has_the_answers(path, new, tmp_path):
    table = tmp_path / "law.csv"
    line = ["law", str(path), *AT, "--pressure", "0.002,0.02", "--conductivity", "50"]
    files = ["--csv", str(table), "--header", str(tmp_path / "law.h")]
    assert learn_cli.main([*line, *files]) == 0
    rows = csv_rows(table)
    by_pressure = [row for row in rows if row["against"] == "pressure_MPa"]
    # There are no edges: the closure is Delta.
    for name, target in (("area_percent", "area"), ("closure_um", "delta")):
        assert column(by_pressure, name) == pytest.approx(new.values[target][:2])
        assert column(by_pressure, f"{name}_high") == pytest.approx(new.high[target][:2])
    assert [row["area_percent_high"] for row in rows[:3]] == ["", "", ""]  # over Delta


def test_a_server_has_the_answers(path, new):
    model = SurrogateModel(path)
    assert model.input_sizes == [2, 1]
    answers = new.area[0], new.low["area"][0], new.high["area"][0], 1.0
    served = model.evaluate([[0.7, 1.2], [0.002]], Configuration())
    assert served[0] == pytest.approx(answers)
    with pytest.raises(InputError, match="for all surfaces"):
        model.evaluate([[0.7, 1.2], [0.002]], Configuration(surface=3))


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A folder with a surrogate of few rows, a surface and a table."""
    folder = tmp_path_factory.mktemp("small")
    np.save(folder / "surface.npy", np.eye(3))
    (folder / "asked.csv").write_text("hurst,rms_height\n0.6,1.0\n")
    surrogate_of(
        database_of(folder, SCENE.replace("240", "120"), "s"), "--features", "scene"
    )
    return folder


LINE = ["--at", "hurst=0.7,rms_height=1", "--pressure", "0.01"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--at", "hurst=0.7", "--pressure", "0.01"], "rms_height not given"),
        (
            ["--at", "hurst=0.7,rms_height=1,roll=2", "--pressure", "0.01"],
            "roll: unknown",
        ),
        (["--at", "hurst=much,rms_height=1", "--pressure", "0.01"], "give NAME=NUMBER"),
        (
            ["--at", "hurst=0.7,hurst=0.8,rms_height=1", "--pressure", "0.01"],
            "once a name",
        ),
        ([*LINE, "--young", "2e5"], "that of its scene"),
        ([*LINE, "--fill"], "reads no surfaces"),
        (["asked.csv", "--at", "hurst=0.7", "--pressure", "0.01"], "has its own hurst"),
        (["surface.npy", "--delta", "1"], "not for surfaces: ask"),
        (["surface.npy"], "tables whose names end in .csv or .txt"),
    ],
)
def test_wrong_numbers_are_refused_in_a_line(small, refused, options, said):
    options = [
        str(small / each) if each.endswith((".npy", ".csv")) else each for each in options
    ]
    assert said in refused(learn_cli, "predict", small / "s.surrogate", *options)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["surface.npy"], "leave out surfaces"),
        (["--at", "hurst=0.7,rms_height=1", "--delta", "1"], "give --pressure instead"),
        (["--at", "hurst=0.7"], "rms_height not given"),
    ],
)
def test_wrong_numbers_of_a_law_are_refused_in_a_line(small, refused, options, said):
    options = [str(small / each) if each.endswith(".npy") else each for each in options]
    assert said in refused(learn_cli, "law", small / "s.surrogate", *options)


def test_a_table_of_answers_can_be_asked_again(path, tmp_path, capsys):
    (tmp_path / "asked.csv").write_text("hurst,rms_height\n0.6,1.0\n")
    first = predicted(
        path, tmp_path, str(tmp_path / "asked.csv"), "--pressure", "0.002,0.02"
    )
    assert "warning" not in capsys.readouterr().err
    table = (tmp_path / "answers.csv").rename(tmp_path / "first.csv")
    assert "pressure_MPa" in table.read_text()
    again = predicted(path, tmp_path, str(table))
    assert "answers take the place of its own flag, reason" in capsys.readouterr().err
    assert column(again, "area_percent") == column(first, "area_percent")


def test_a_growth_of_scene_features_takes_no_model_without_an_error_of_its_mean(
    small, refused
):
    line = ["grow", small / "s.toml", "--features", "scene", "--model", "mlp"]
    told = refused(learn_cli, *line, "-o", small / "g.surrogate")
    assert "population alone knows the error" in told


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """Options of a database, the folder of its comparison, and R2 of both models compared."""
    made = tmp_path_factory.mktemp("compared")
    folder = made / "out"
    of_scene = ["--features", "scene", "--model", "population"]
    asked = [str(database_of(made, SCENE)), "-o", str(folder), *of_scene]
    assert learn_cli.main(["compare", *asked, "--model", "decision-tree"]) == 0
    results = Folder(folder / "area").results()
    return asked, folder, {stored.model: stored.result.test.r2 for stored in results}


@pytest.mark.long
def test_a_comparison_of_scene_features_has_the_population_ahead(compared):
    _, _, r2 = compared
    assert r2["population"] > r2["decision-tree"]


@pytest.mark.long
def test_a_comparison_of_scene_features_says_which_model_fit_takes(compared, capsys):
    asked, _, _ = compared
    assert learn_cli.main(["compare", *asked]) == 0
    assert "takes Population Mean unless told otherwise" in capsys.readouterr().out


@pytest.mark.long
@pytest.mark.parametrize("tuned", [False, True])
def test_a_fit_to_a_scene_is_as_good_as_its_comparison(compared, tmp_path, tuned):
    asked, folder, r2 = compared
    database, _, _, *of_scene = asked
    options = []
    if tuned:
        assert learn_cli.main(["tune", *asked]) == 0
        options = ["--from", str(folder)]
    path = tmp_path / "s.surrogate"
    line = ["fit", database, *of_scene, "--target", "area", *options, "-o", str(path)]
    assert learn_cli.main(line) == 0
    scores = Surrogate.load(path).card["targets"]["area"]["scores"]
    assert scores["r2"] == pytest.approx(r2["population"], rel=0.01)  # cut at 100 %


def test_the_force_is_no_target_at_a_pressure(small, refused):
    command = ["fit", small / "s.h5", "--features", "scene", "--target", "force"]
    assert "force" in refused(learn_cli, *command, "-o", small / "f.surrogate")
