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


def test_scheme_and_kind_follow_the_number_of_maps(rows):
    alone = calibration.groups_of(rows)
    assert (alone.number, alone.kind, alone.scheme) == (rows.size, "surface", "surfaces")
    few, many = (calibration.groups_of(of_maps(rows, number)) for number in (4, 9))
    assert (few.number, few.kind, few.scheme) == (4, "map", "each")
    assert (many.number, many.kind, many.scheme) == (9, "map", "others")
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


def test_flags_and_intervals_see_the_skewness_and_models_do_not(solved):
    rows = read(solved, "area", features="hybrid", roots=True)
    inputs, place = rows.inputs.copy(), rows.features.columns.index(SKEWNESS)
    inputs[:, place] = 0.1 * np.random.default_rng(0).normal(size=rows.size)
    given, request = {"kernel": "rbf", "gamma": 0.01, "alpha": 1e-3}, request_of(solved)
    plain, seeing = (
        fit_to(replace(request, features="hybrid"), each, given)
        for each in (rows, replace(rows, inputs=inputs))
    )
    np.testing.assert_array_equal(
        seeing.learnt.raw(inputs), plain.learnt.raw(rows.inputs)
    )
    np.testing.assert_array_equal(seeing.left_out, plain.left_out)
    odd = inputs[:1].copy()
    odd[:, place] = 3.0
    distance = calibration.plan_calibration("svm", replace(rows, inputs=inputs)).distance
    assert distance.of(odd) > distance.limit
    raw = seeing.learnt.raw(odd)
    (_, usual), (_, wider) = (
        seeing.learnt.calibration.ends(raw, 0.9, each) for each in (inputs[:1], odd)
    )
    assert wider > usual


def test_databases_of_the_same_surfaces_are_not_left_out_whole(rows):
    made = of_maps(rows, 9)
    related = replace(made, groups=rows.groups // 30, by_tile=False)
    assert calibration.groups_of(related).scheme == "each"
    alone = replace(related, groups=np.zeros_like(rows.groups))
    assert calibration.groups_of(alone).scheme == "surfaces", "all rows share surfaces"
    assert calibration.groups_of(alone).kind == "row"


def fitted(solved, number, target="area"):
    request = replace(request_of(solved), targets=(target,))
    sets = [of_maps(rows, number) for rows in dataset.read(request, common=True)]
    said = []
    return fitting.fit_parts(request, sets, split.draw(sets[0]), said.append), said


def test_files_keep_intervals_by_maps(solved, tmp_path):
    surrogate, said = fitted(solved, 10)
    assert any("each predicted without it" in line for line in said)
    surrogate.save(tmp_path / "a.surrogate")
    again = Surrogate.load(tmp_path / "a.surrogate")
    assert again.card["calibration"]["groups"] == 10
    assert again.card["rows"]["calibration"] == again.card["rows"]["train"] == 72
    inputs = surrogate.low + 0.4 * (surrogate.high - surrogate.low)[None, :] * np.ones(
        (3, 1)
    )
    inputs[2] = surrogate.high
    intervals, loaded = (each.learnt["area"].calibration for each in (surrogate, again))
    raw = np.array([1.0, 4.0, 9.0])
    np.testing.assert_array_equal(
        intervals.ends(raw, 0.9, inputs), loaded.ends(raw, 0.9, inputs)
    )
    np.testing.assert_array_equal(
        surrogate.distance.of(inputs), again.distance.of(inputs)
    )
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


def test_rows_of_another_database_calibrate(solved, here, capsys):
    other = database_of(here, "samples = 40\nseed = 5\n[surface]\nnodes = 33\n")
    with h5py.File(other, "r+") as file:
        file["force"][3] *= 1.001
    capsys.readouterr()
    assert run("fit", solved, "--calibrate-on", other, "-o", "a.surrogate") == 0
    notes = capsys.readouterr().err
    assert "72 rows train, 40 calibrate, 18 test" in notes
    assert f"warning: {other}: row 3 has other bytes than were written" in notes
    card = Surrogate.load("a.surrogate").card
    assert card["calibration"]["database"] == str(other)
    assert card["database"] == str(solved)
    assert card["nodes"] == [33, 33]
    assert "databases" not in card
    assert run("card", "a.surrogate") == 0
    assert f"calibrated by 40 surfaces of {other}" in capsys.readouterr().out
    assert (
        run("predict", "a.surrogate", "x.npy", "--delta", "3", "--interval", "0.98") == 2
    )
    assert (
        "calibrated by 40 surfaces, which reach 0.975 at most" in capsys.readouterr().err
    )


@pytest.mark.usefixtures("here")
def test_the_same_rows_are_no_calibration(solved, mirrored, refused):
    for path, words in ((solved, str(solved)), (mirrored, "boundary")):
        assert words in refused(
            cli, "fit", solved, "--calibrate-on", path, "-o", "a.surrogate"
        )
