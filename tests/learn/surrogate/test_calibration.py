"""Intervals that are calibrated by groups: maps, or databases."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from comparisons import run
from databases import database_of
from learnt_rows import read

from gen.runtime.errors import InputError
from learn import Surrogate, cli, dataset, split
from learn.comparison.folder import Settings
from learn.dataset import Request
from learn.executor import Executor
from learn.features.columns import SKEWNESS
from learn.surrogate import calibration, fitting
from learn.surrogate.fitting import fit_target
from learn.surrogate.level import require_level


def of_maps(rows, number):
    """The same rows as if each surface were of one of some maps."""
    return replace(rows, population=rows.groups % number, by_tile=True)


@pytest.fixture(scope="module")
def rows(solved):
    return read(solved, "area", features="dimensionless", roots=True)


def request_of(path, model="kernel-ridge"):
    return Request(
        databases=(path,),
        output=path,
        models=(model,),
        features="dimensionless",
        normalisation="standard",
        roots=True,
    )


def described(groups):
    return groups.number, groups.kind, groups.scheme


def test_surfaces_of_one_database_are_one_group(rows):
    assert described(calibration.groups_of(rows)) == (rows.size, "surface", "surfaces")


@pytest.mark.parametrize(("number", "scheme"), [(4, "each"), (9, "others")])
def test_the_scheme_follows_the_number_of_maps(rows, number, scheme):
    groups = calibration.groups_of(of_maps(rows, number))
    assert described(groups) == (number, "map", scheme)


def test_rows_of_several_databases_are_grouped_by_these(rows):
    pooled = replace(rows, population=rows.rows % 2)
    assert calibration.groups_of(pooled).kind == "database"


def fit_to(request, rows, values):
    """A fit of given settings to all rows."""
    plan = calibration.plan_calibration(request.models[0], rows)
    folds = np.zeros(rows.size, np.int8)
    return fit_target(
        request, rows, plan, folds, settings=Settings(values, False, "given")
    )


@pytest.mark.parametrize(
    ("model", "values"), [("kernel-ridge", {}), ("decision-tree", {})]
)
@pytest.mark.parametrize("number", [4, 10])
def test_no_row_is_predicted_by_a_model_that_has_seen_its_map(
    rows, solved, model, values, number
):
    train = of_maps(rows, number)
    values = (
        {"kernel": "rbf", "gamma": 0.01, "alpha": 1e-3}
        if model == "kernel-ridge"
        else values
    )
    fit = fit_to(request_of(solved, model), train, values)
    groups = calibration.groups_of(train)
    holdout = next(calibration.holdouts(train, groups.left_out(train)))
    part, unseen = holdout.rows, holdout.unseen
    if number == 10:
        assert np.unique(groups.labels[part]).size == 1
    # Other targets in the part change nothing about its own predictions, but for the scaling.
    spoilt = train.target.copy()
    spoilt[unseen] = np.roll(spoilt[unseen], 1)
    again = fit_to(request_of(solved, model), replace(train, target=spoilt), values)
    np.testing.assert_allclose(again.left_out[part], fit.left_out[part], rtol=1e-6)
    others = np.setdiff1d(np.arange(train.size), part)
    assert not np.allclose(again.left_out[others], fit.left_out[others], rtol=1e-3)


@pytest.mark.parametrize(
    ("model", "number"), [("kernel-ridge", 90), ("decision-tree", 36)]
)
def test_further_fits_are_as_few_as_have_surfaces_enough(
    solved, rows, monkeypatch, model, number
):
    """Parts of 18 surfaces: two have 30, and kernel ridge tells the errors of all of them."""
    monkeypatch.setattr(calibration, "ENOUGH", 30)
    fit = fit_to(request_of(solved, model), rows, {})
    assert np.isfinite(fit.left_out).sum() == number
    assert [
        each.weights.sum() for each in fit.learnt.calibration.scores
    ] == pytest.approx([number])
    assert calibration.plan_calibration(model, rows).groups.number == number


@pytest.fixture(scope="module")
def hybrid(solved):
    return read(solved, "area", features="hybrid", roots=True)


@pytest.fixture(scope="module")
def skewed(hybrid):
    """The same rows with a skewness of their own."""
    inputs = hybrid.inputs.copy()
    place = hybrid.features.columns.index(SKEWNESS)
    inputs[:, place] = 0.1 * np.random.default_rng(0).normal(size=hybrid.size)
    return replace(hybrid, inputs=inputs)


@pytest.fixture(scope="module")
def fit_to_skewed(solved, skewed):
    return fit_to_hybrid(solved, skewed)


@pytest.fixture
def odd(skewed):
    """The first row with a skewness that no row has."""
    inputs = skewed.inputs[:1].copy()
    inputs[:, skewed.features.columns.index(SKEWNESS)] = 3.0
    return inputs


def fit_to_hybrid(solved, rows):
    request = replace(request_of(solved), features="hybrid")
    return fit_to(request, rows, {"kernel": "rbf", "gamma": 0.01, "alpha": 1e-3})


def test_models_do_not_see_the_skewness(solved, hybrid, skewed, fit_to_skewed):
    plain = fit_to_hybrid(solved, hybrid)
    np.testing.assert_array_equal(
        fit_to_skewed.learnt.raw(skewed.inputs), plain.learnt.raw(hybrid.inputs)
    )
    np.testing.assert_array_equal(fit_to_skewed.left_out, plain.left_out)


def test_flags_see_the_skewness(skewed, odd):
    distance = calibration.plan_calibration("svm", skewed).distance
    assert distance.of(odd) > distance.limit


def test_intervals_see_the_skewness(skewed, fit_to_skewed, odd):
    learnt = fit_to_skewed.learnt
    raw = learnt.raw(odd)
    _, usual = learnt.calibration.ends(raw, 0.9, skewed.inputs[:1])
    _, wider = learnt.calibration.ends(raw, 0.9, odd)
    assert wider > usual


def test_databases_of_the_same_surfaces_are_not_left_out_whole(rows):
    made = of_maps(rows, 9)
    related = replace(made, groups=rows.groups // 30, by_tile=False)
    assert calibration.groups_of(related).scheme == "each"
    alone = replace(related, groups=np.zeros_like(rows.groups))
    assert calibration.groups_of(alone).scheme == "surfaces", "all rows share surfaces"
    assert calibration.groups_of(alone).kind == "row"


@pytest.fixture(scope="module")
def by_maps(solved):
    """A surrogate of ten maps, and the lines that its fit says."""
    request = request_of(solved)
    sets = [of_maps(rows, 10) for rows in dataset.read(request, common=True)]
    lines = []
    return fitting.fit_parts(request, sets, split.draw(sets[0]), lines.append), lines


@pytest.fixture
def again(by_maps, tmp_path):
    """The surrogate of ten maps from its file."""
    by_maps[0].save(tmp_path / "a.surrogate")
    return Surrogate.load(tmp_path / "a.surrogate")


def test_the_user_is_told_that_maps_calibrate(by_maps):
    assert any("each predicted without it" in line for line in by_maps[1])


def test_files_keep_intervals_and_distances_by_maps(by_maps, again):
    surrogate, _ = by_maps
    assert again.card["calibration"]["groups"] == 10
    assert again.card["rows"]["calibration"] == again.card["rows"]["train"] == 72
    place = surrogate.low + 0.4 * (surrogate.high - surrogate.low)
    inputs = np.array([place, place, surrogate.high])
    raw = np.array([1.0, 4.0, 9.0])
    np.testing.assert_array_equal(
        surrogate.learnt["area"].calibration.ends(raw, 0.9, inputs),
        again.learnt["area"].calibration.ends(raw, 0.9, inputs),
    )
    np.testing.assert_array_equal(
        surrogate.distance.of(inputs), again.distance.of(inputs)
    )


def test_ten_maps_calibrate_levels_of_90_percent_and_not_of_95(again):
    require_level(again, 0.9)
    with pytest.raises(
        InputError, match=r"0.95: intervals of area are calibrated by 10 maps, wh"
    ):
        require_level(again, 0.95)


def test_intervals_of_a_file_are_those_that_were_fitted(solved, tmp_path):
    found = fitting.fit(request_of(solved), Executor(), lambda line: None)
    found.save(tmp_path / "x.surrogate")
    area = Surrogate.load(tmp_path / "x.surrogate").learnt["area"]
    rows = read(solved, "area", features="dimensionless", roots=True)
    raw = area.raw(rows.inputs)
    ends = found.learnt["area"].calibration.ends(raw, 0.9, rows.inputs)
    np.testing.assert_array_equal(area.calibration.ends(raw, 0.9, rows.inputs), ends)
    assert (ends[1] > ends[0]).all()
    far = np.argsort(found.distance.of(rows.inputs))
    width = np.sqrt(ends[1]) - np.sqrt(raw)
    usual = area.calibration.usual.at(rows.inputs)
    assert (np.diff((width / usual)[far]) >= -1e-9).all()


def test_surfaces_count_and_not_their_rows(rows, solved):
    """Of 4 surfaces with many loads each the largest level is 0.8, and refused are higher ones."""
    few = replace(rows, groups=rows.rows % 5)
    found = fitting.fit_parts(
        request_of(solved), [few], split.draw(few), lambda line: None
    )
    assert found.card["calibration"]["groups"] == 4
    require_level(found, 0.8)
    words = r"calibrated by 4 surfaces, which reach 0.8 at most: give less, or fit to more of them"
    with pytest.raises(InputError, match=words):
        require_level(found, 0.9)


@pytest.fixture
def by_another(solved, here, capsys):
    """Another database, of which a byte has changed, and what a fit says that it calibrates."""
    other = database_of(here, "samples = 40\nseed = 5\n[surface]\nnodes = 33\n")
    with h5py.File(other, "r+") as file:
        file["force"][3] *= 1.001
    capsys.readouterr()
    assert run("fit", solved, "--calibrate-on", other, "-o", "a.surrogate") == 0
    return other, capsys.readouterr().err


def test_rows_of_another_database_calibrate(by_another):
    assert "72 rows train, 40 calibrate, 18 test" in by_another[1]


def test_damage_of_a_database_that_calibrates_is_said(by_another):
    other, notes = by_another
    assert f"warning: {other}: row 3 has other bytes than were written" in notes


def test_the_card_tells_training_from_calibration(by_another, solved, capsys):
    other, _ = by_another
    card = Surrogate.load("a.surrogate").card
    assert card["calibration"]["database"] == str(other)
    assert card["database"] == str(solved)
    assert card["nodes"] == [33, 33]
    assert "databases" not in card
    assert run("card", "a.surrogate") == 0
    assert f"calibrated by 40 surfaces of {other}" in capsys.readouterr().out


@pytest.mark.usefixtures("by_another")
def test_the_largest_level_is_that_of_the_database_that_calibrates(capsys):
    line = ("predict", "a.surrogate", "x.npy", "--delta", "3", "--interval", "0.98")
    assert run(*line) == 2
    words = "calibrated by 40 surfaces, which reach 0.975 at most"
    assert words in capsys.readouterr().err


@pytest.mark.usefixtures("here")
def test_the_same_rows_are_no_calibration(solved, mirrored, refused):
    for path, words in ((solved, str(solved)), (mirrored, "boundary")):
        assert words in refused(
            cli, "fit", solved, "--calibrate-on", path, "-o", "a.surrogate"
        )
