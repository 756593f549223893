"""Surrogates of every model: fitted, stored, asked."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from databases import database_of
from learnt_rows import fitted, read

import bem
from asperity.functions import SurrogateFunction
from gen.law import Order
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from gen.surface import generate
from learn import Surrogate, split
from learn import cli as learn_cli
from learn.comparison.paper import OPTIMA
from learn.features.columns import ROOTED_LOCAL
from learn.models import MODELS
from learn.surrogate import fitting, law
from learn.surrogate.card import lines
from learn.surrogate.learnt import Learnt


@pytest.fixture(scope="module")
def ridge(solved):
    return fitted(solved)


@pytest.fixture(scope="module")
def contact(heights):
    return bem.solve(heights, 1000.0, 20.0)


@pytest.fixture(scope="module")
def pressure(contact):
    """The mean pressure of the contact over the cells of all nodes [MPa]."""
    return contact.force / (1000.0 * 33 / 32) ** 2


@pytest.fixture(scope="module", params=["paper", "dimensionless", "hybrid"])
def by_pressure(request, solved, tmp_path_factory):
    """The file of a surrogate by pressure; a database by Delta has a pressure in each row."""
    file = tmp_path_factory.mktemp(request.param) / "p.surrogate"
    options = ["--features", request.param, "--load", "pressure", "-o", str(file)]
    assert learn_cli.main(["fit", str(solved), *options]) == 0
    return file


@pytest.fixture
def question(by_pressure, pressure, heights, tmp_path):
    """Words of the command line that ask for the surface at the pressure, and at twice of it."""
    surface = tmp_path / "s.npy"
    np.save(surface, heights)
    pressures = f"{pressure},{2 * pressure}"
    return [
        str(by_pressure),
        str(surface),
        "--side",
        "1000",
        "--pressure",
        pressures,
    ]


@pytest.fixture
def answer(by_pressure, pressure, heights):
    """The prediction of the surface at the pressure, and at twice of it."""
    pressures = [pressure, 2 * pressure]
    return Surrogate.load(by_pressure).predict(heights, 1000.0, pressure=pressures)


def test_contacts_under_a_pressure_are_learnt(answer, contact, by_pressure):
    """The coarse solve of the hybrid features is exact here."""
    exact = 0.02 if Surrogate.load(by_pressure).features.name == "hybrid" else 0.4
    assert answer.area[0] == pytest.approx(contact.area_percent, rel=exact)
    assert answer.values["delta"][0] == pytest.approx(20.0, rel=exact)
    assert np.isnan(answer.delta).all()


def test_stiffer_bodies_touch_the_same_at_a_pressure_as_much_larger(
    answer, pressure, by_pressure, heights
):
    stiffer = Surrogate.load(by_pressure).predict(
        heights, 1000.0, pressure=10 * pressure, e_star=10.0
    )
    assert stiffer.area == pytest.approx(answer.area[:1])


def test_the_command_line_predicts_by_pressure(answer, pressure, question, tmp_path):
    csv = tmp_path / "p.csv"
    assert learn_cli.main(["predict", *question, "-o", str(csv)]) == 0
    rows = np.genfromtxt(csv, names=True, delimiter=",", dtype=None, encoding=None)
    assert rows["area_percent"] == pytest.approx(answer.area)
    assert rows["pressure_MPa"] == pytest.approx([pressure, 2 * pressure])


@pytest.mark.parametrize("surfaces", [1, 2])
def test_laws_are_tabulated_by_pressure(answer, question, heights, tmp_path, surfaces):
    csv, twin = tmp_path / "p.csv", tmp_path / "t.npy"
    np.save(twin, heights.T)
    files = [question[1], str(twin)][:surfaces]
    line = ["law", question[0], *files, *question[2:], "--csv", str(csv)]
    assert learn_cli.main(line) == 0
    rows = pd.read_csv(csv)
    over = rows[rows["against"] == "pressure_MPa"]
    assert over["area_percent"].iloc[-1] == pytest.approx(
        answer.area[1], rel=1e-6 if surfaces == 1 else 0.2
    )


def test_functions_are_served_by_pressure(by_pressure, pressure):
    served = SurrogateFunction(by_pressure)
    numbers = {"hurst": 0.7, "sigma0": 12.0, "pressure": pressure}
    assert served(**{name: numbers[name] for name in served.names})[0] > 0


def test_a_surrogate_by_pressure_refuses_a_displacement(question, capsys):
    assert learn_cli.main(["predict", *question[:4], "--delta", "20"]) == 2
    assert "give some, and --pressure" in capsys.readouterr().err


@pytest.mark.long
def test_models_are_compared_by_pressure_and_their_winner_fitted(solved, tmp_path):
    asked = [str(solved), "--model", "decision-tree", "-o"]
    assert (
        learn_cli.main(["compare", *asked, str(tmp_path / "c"), "--load", "pressure"])
        == 0
    )
    by_pressure = [
        "--load",
        "pressure",
        "--target",
        "area",
        "--from",
        str(tmp_path / "c"),
    ]
    assert (
        learn_cli.main(["tune", *asked, str(tmp_path / "c"), "--load", "pressure"]) == 0
    )
    assert (
        learn_cli.main(["fit", *asked, str(tmp_path / "s.surrogate"), *by_pressure]) == 0
    )
    assert Surrogate.load(tmp_path / "s.surrogate").features.load == "pressure"


@pytest.fixture(scope="module")
def heights():
    return generate("diamond-square", 33, 0.7, 12.0, np.random.default_rng(5))


@pytest.fixture(scope="module", params=list(MODELS))
def kept(request, solved, tmp_path_factory):
    """A surrogate of each model, and the one that its file gives."""
    model = request.param
    with pytest.MonkeyPatch.context() as patch:
        if "n_estimators" in OPTIMA[model]:
            patch.setitem(OPTIMA[model], "n_estimators", 30)
        patch.setitem(fitting.BUILT_IN["mlp"], "max_iter", 200)
        surrogate = fitted(solved, model, "hybrid")
    file = tmp_path_factory.mktemp("kept") / "x.surrogate"
    surrogate.save(file)
    return surrogate, Surrogate.load(file)


@pytest.fixture(scope="module")
def kept_answers(kept, heights):
    """The predictions of both."""
    deltas = np.array([6.0, 20.0, 44.0])
    return [each.for_surface(heights, 1000.0).predict(deltas) for each in kept]


@pytest.mark.few(3)
def test_files_of_every_model_keep_its_predictions_and_intervals(kept_answers):
    first, again = kept_answers
    for target in ("area", "force"):
        np.testing.assert_array_equal(again.values[target], first.values[target])
        np.testing.assert_array_equal(again.low[target], first.low[target])
        np.testing.assert_array_equal(again.high[target], first.high[target])


@pytest.mark.few(3)
def test_files_of_every_model_keep_its_card(kept):
    surrogate, loaded = kept
    assert loaded.card == surrogate.card


@pytest.mark.few(3)
def test_intervals_of_every_model_begin_below_its_predictions(kept_answers):
    answer, _ = kept_answers
    for target in ("area", "force"):
        assert (answer.low[target] <= answer.values[target]).all()


@pytest.mark.few(3)
def test_every_model_explains_most_of_the_area(kept):
    card = kept[0].card
    least = 60 if card["model"] == "decision-tree" else 80  # 58 rows trained it
    assert card["targets"]["area"]["scores"]["r2"] > least


def test_what_it_predicts_are_the_rows_of_its_test(solved):
    from gen.database import Reader
    from gen.generation.plan import parameters
    from gen.generation.sample import surface_of
    from learn import metrics

    surrogate = fitted(solved)
    rows = read(solved, "force")
    test = split.draw(rows).test
    with Reader(solved) as reader:
        scene = reader.scene
    plan = parameters(scene, 0, 90)
    predicted = [
        surrogate.predict(surface_of(scene, plan, row), 1000.0, plan.load[row]).force[0]
        for row in rows.rows[test]
    ]
    again = vars(metrics.scores(rows.target[test], np.array(predicted)))
    assert surrogate.card["targets"]["force"]["scores"] == pytest.approx(again)


@pytest.fixture(scope="module")
def rooted(solved):
    """A surrogate as `learn fit --features hybrid` makes it, with square roots."""
    return fitted(solved, features="hybrid", roots=True)


DELTAS = np.linspace(2.0, 40.0, 9)


@pytest.fixture
def rooted_file(rooted, tmp_path):
    """The surrogate with square roots as its file gives it."""
    rooted.save(tmp_path / "rooted.surrogate")
    return Surrogate.load(tmp_path / "rooted.surrogate")


def test_files_keep_the_features_that_are_square_roots(rooted_file):
    names = tuple(f"sqrt({name})" for name in ROOTED_LOCAL)
    assert rooted_file.features.columns[-7:] == names
    assert rooted_file.card["blocks"] == 33


def test_files_keep_that_the_area_alone_is_learnt_as_a_root(rooted_file):
    assert rooted_file.learnt["area"].scaling.root
    assert not rooted_file.learnt["force"].scaling.root


def test_files_keep_predictions_by_square_roots(rooted, rooted_file, heights):
    answer = rooted.predict(heights, 1000.0, DELTAS)
    again = rooted_file.predict(heights, 1000.0, DELTAS)
    np.testing.assert_array_equal(again.area, answer.area)


def test_roots_of_areas_are_squared_again(rooted, heights):
    answer = rooted.predict(heights, 1000.0, DELTAS)
    inputs = rooted.features.of(rooted.for_surface(heights, 1000.0).rows(DELTAS))
    area = rooted.learnt["area"]
    roots = area.scaling.mean + area.scaling.deviation * area.pipeline.predict(inputs)
    np.testing.assert_allclose(answer.area, np.maximum(roots, 0) ** 2, rtol=1e-9)


def test_intervals_are_symmetric_about_the_root_where_no_bound_cuts_them(rooted, heights):
    answer = rooted.predict(heights, 1000.0, DELTAS)
    low, high = answer.low["area"], answer.high["area"]
    assert (low <= answer.area).all()
    uncut = (low > 0) & (high < 100)
    assert uncut.sum() > 2
    middle = (np.sqrt(low) + np.sqrt(high))[uncut] / 2
    np.testing.assert_allclose(middle, np.sqrt(answer.area)[uncut], rtol=1e-9)


def test_a_displacement_outside_the_training_is_flagged(ridge, heights):
    assert ridge.predict(heights, 1000.0, 1e-3).reasons[0].startswith("delta/h")


def test_another_number_of_nodes_is_flagged(ridge):
    finer = generate("diamond-square", 65, 0.7, 12.0, np.random.default_rng(5))
    (reason,) = ridge.predict(finer, 1000.0, 9.0).reasons
    assert "65 x 65 nodes, trained on 33 x 33" in reason


def test_an_oblong_patch_is_flagged_after_a_training_of_square_ones(ridge, heights):
    (reason,) = ridge.predict(heights, (1000.0, 500.0), 9.0).reasons
    assert "1000 x 500 um, trained on square patches" in reason


def test_loads_of_the_training_are_not_flagged(ridge, heights):
    assert ridge.predict(heights, 1000.0, [5.0, 10.0, 20.0, 30.0]).inside.sum() >= 2


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda s, z: s.predict(z, 1000.0, 0.0), "above 0"),
        (lambda s, z: s.predict(z, -1.0, 5.0), "side"),
        (lambda s, z: s.predict(z * np.nan, 1.0, 5.0), "finite"),
        (lambda s, z: s.predict(z, 1.0, 5.0, e_star=0.0), "modulus"),
    ],
)
def test_wrong_questions_are_refused(ridge, heights, call, word):
    with pytest.raises(InputError, match=word):
        call(ridge, heights)


@pytest.fixture
def inside_rows(ridge, heights):
    rows = ridge.for_surface(heights, 1000.0).rows([10.0, 20.0])
    assert ridge.predict_rows(rows).inside.any()
    return rows


@pytest.fixture(params=[np.nan, np.inf])
def spoilt(request, ridge):
    """A surrogate whose predictions are not finite."""
    learnt = {
        name: replace(each, scaling=replace(each.scaling, deviation=request.param))
        for name, each in ridge.learnt.items()
    }
    return replace(ridge, learnt=learnt)


def test_a_prediction_that_is_not_finite_is_never_inside(spoilt, inside_rows):
    answer = spoilt.predict_rows(inside_rows)
    assert not answer.inside.any()
    assert "the surrogate has no finite area" in answer.reasons[0]


def test_a_prediction_that_is_not_finite_is_nan_with_its_interval(spoilt, inside_rows):
    answer = spoilt.predict_rows(inside_rows)
    assert np.isnan(answer.area).all()
    assert np.isnan(answer.high["force"]).all()


def test_a_law_of_predictions_that_are_not_finite_is_refused(spoilt, heights, tmp_path):
    np.save(tmp_path / "h.npy", heights)
    maps = (str(tmp_path / "h.npy"),)
    order = Order(maps, delta="5:20:3", reading=Reading(side="1000"))
    refusal = r"h\.npy: the surrogate has no finite .* at Delta = 5"
    with pytest.raises(InputError, match=refusal):
        law.law_of_surfaces(spoilt, order)


def test_an_answer_at_a_bound_has_an_interval_with_width(solved, heights, monkeypatch):
    surrogate = fitted(solved, features="paper")
    monkeypatch.setattr(Learnt, "raw", lambda self, inputs: np.full(len(inputs), -1e9))
    answer = surrogate.predict(heights, 1000.0, [5.0, 30.0])
    for name, high in answer.high.items():
        assert (answer.values[name] == 0).all()
        assert (answer.low[name] == 0).all()
        assert (high > 0).all()


@pytest.fixture(scope="module")
def plastic(yielding):
    """A surrogate of bodies that yield at 0.003 to 0.1 E*."""
    return fitted(
        yielding, features="hybrid", targets=("area", "force", "yielded_percent")
    )


def test_bodies_that_yield_touch_more_at_a_smaller_hardness(plastic, heights):
    soft = plastic.predict(heights, 1000.0, [8.0, 20.0], hardness=0.004)
    hard = plastic.predict(heights, 1000.0, [8.0, 20.0], hardness=0.09)
    assert (soft.area > hard.area).all()
    assert (soft.force < hard.force).all()
    assert (soft.values["yielded_percent"] > hard.values["yielded_percent"]).all()
    assert (soft.values["yielded_percent"] <= 100).all()


def test_files_keep_the_hardness(plastic, heights, tmp_path):
    plastic.save(tmp_path / "plastic.surrogate")
    loaded = Surrogate.load(tmp_path / "plastic.surrogate")
    assert loaded.card["hardness_ratio"] == pytest.approx([0.003, 0.1])
    answer = plastic.predict(heights, 1000.0, [8.0, 20.0], hardness=0.004)
    again = loaded.predict(heights, 1000.0, [8.0, 20.0], hardness=0.004)
    np.testing.assert_array_equal(again.area, answer.area)


@pytest.fixture
def on_surface(plastic, heights):
    return plastic.for_surface(heights, 1000.0)


def test_a_hardness_outside_the_training_is_flagged(on_surface):
    for hardness in (0.0029, 0.11):
        (reason,) = on_surface.predict(12.0, hardness=hardness).reasons
        assert f"hardness/E* {hardness:.4g} outside 0.003 to 0.1" in reason
    assert "hardness/E*" not in on_surface.predict(12.0, hardness=0.02).reasons[0]


def test_several_hardnesses_of_the_training_ask_for_one(on_surface):
    with pytest.raises(
        InputError, match=r"give --hardness: .* yield at 0\.003 to 0\.1 E"
    ):
        on_surface.predict(12.0)


@pytest.mark.parametrize("hardness", [0.0, -1.0, np.nan, np.inf])
def test_an_impossible_hardness_is_refused(on_surface, hardness):
    with pytest.raises(InputError, match=r"hardness = .* must be a hardness above 0 MPa"):
        on_surface.predict(12.0, hardness=hardness)


@pytest.fixture(scope="module")
def of_one_hardness(tmp_path_factory):
    """A surrogate of bodies that yield at 0.02 E*."""
    text = "samples = 60\n[surface]\nnodes = 33\n[contact]\nhardness_ratio = 0.02\n"
    return fitted(database_of(tmp_path_factory.mktemp("hardness"), text))


def test_the_only_hardness_of_the_training_is_the_default(of_one_hardness, heights):
    assert of_one_hardness.hardness_limits == pytest.approx((0.02, 0.02))
    default = of_one_hardness.predict(heights, 1000.0, 12.0)
    named = of_one_hardness.predict(heights, 1000.0, 12.0, hardness=2.0, e_star=100.0)
    np.testing.assert_allclose(named.area, default.area, rtol=1e-9)


def test_the_only_hardness_of_the_training_is_not_flagged(of_one_hardness, heights):
    for numbers in ({}, {"hardness": 2.0, "e_star": 100.0}):
        (reason,) = of_one_hardness.predict(heights, 1000.0, 12.0, **numbers).reasons
        assert "hardness" not in reason


def test_a_hardness_that_is_not_the_only_one_is_flagged(of_one_hardness, heights):
    (reason,) = of_one_hardness.predict(heights, 1000.0, 12.0, hardness=0.021).reasons
    assert "hardness/E* 0.021 outside 0.02 to 0.02" in reason


@pytest.fixture(scope="module")
def cells(mirrored):
    """A surrogate of patches between mirror images."""
    return fitted(mirrored, features="hybrid")


def test_patches_are_free_if_no_card_says_otherwise(ridge):
    assert "boundary" not in ridge.card
    assert ridge.boundary == "free"


@pytest.fixture
def on_cells(cells, heights):
    return cells.for_surface(heights[:-1, :-1], 1000.0)


def test_a_surrogate_knows_the_boundary_of_its_patches(cells, on_cells, tmp_path):
    cells.save(tmp_path / "cells.surrogate")
    loaded = Surrogate.load(tmp_path / "cells.surrogate")
    assert loaded.card["boundary"] == loaded.boundary == "mirror"
    assert on_cells.surface.boundary == "mirror"
    assert on_cells.surface.spacing == (1000.0 / 32,) * 2


def test_the_grid_of_cells_is_that_of_the_training(on_cells):
    answer = on_cells.predict([2.0, 4.0])
    assert not any("spacing" in reason or "nodes" in reason for reason in answer.reasons)


def test_a_patch_of_cells_has_no_equilibrium_beyond_full_contact(on_cells):
    heights = on_cells.surface.heights
    full = float((heights.max() - heights).mean())
    below, beyond = on_cells.predict([0.9 * full, 1.1 * full]).reasons
    assert "no equilibrium" not in below
    assert beyond.startswith(
        f"no equilibrium: the contact is full at delta = {full:.6g} um"
    )


@pytest.fixture(scope="module")
def oblong(populations):
    """A surrogate of oblong patches, with features without units."""
    return fitted(populations / "spectral.h5", features="hybrid")


def test_files_keep_the_shape_of_oblong_patches(oblong, tmp_path):
    oblong.save(tmp_path / "oblong.surrogate")
    card = Surrogate.load(tmp_path / "oblong.surrogate").card
    assert card["nodes"] == [18, 33]
    assert card["side"] == [700.0, 1200.0]
    assert card["spacing"] == pytest.approx([700 / 17, 1200 / 32])
    assert "18 x 33 nodes, sides 700 x 1200 um" in " ".join(lines(card))


def test_features_without_units_bind_to_the_shape_of_patches_alone(oblong):
    grid_note = oblong.training.grid_note
    assert grid_note((18, 33), (700.0, 1200.0)) == ""
    assert grid_note((18, 33), (7.0, 12.0)) == ""
    assert grid_note((33, 18), (1200.0, 700.0)) == (
        "33 x 18 nodes, trained on 18 x 33; 1200 x 700 um, trained on 700 x 1200 um"
    )


def test_features_without_units_predict_any_size_alike(oblong):
    heights = np.random.default_rng(0).normal(size=(18, 33))
    small = oblong.predict(heights, (700.0, 1200.0), [1.0, 2.0])
    large = oblong.predict(1000 * heights, (700e3, 1200e3), [1e3, 2e3])
    np.testing.assert_allclose(large.area, small.area, rtol=1e-6)
    np.testing.assert_allclose(large.force, 1e6 * small.force, rtol=1e-6)


def test_features_with_units_bind_to_side_and_spacing(populations):
    paper = fitted(populations / "spectral.h5", features="paper")
    grid_note = paper.training.grid_note
    assert grid_note((18, 33), (700.0, 1200.0)) == ""
    assert "side 7 um, trained on 700 um" in grid_note((18, 33), (7.0, 12.0))
    assert "spacing 19.05 um, trained on 37.5 um" in grid_note((18, 64), (700.0, 1200.0))
