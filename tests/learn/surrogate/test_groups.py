"""Intervals that are calibrated by groups: maps, or databases."""

from dataclasses import replace

import numpy as np
import pytest

from gen.runtime.errors import InputError
from learn import Surrogate, dataset, split
from learn.pooling import Population
from learn.request import Request
from learn.surrogate import groups as by_groups
from learn.surrogate import training
from learn.surrogate.calibration_text import require_level
from learn.surrogate.distance import from_training
from learn.surrogate.error_scale import fit_scale
from learn.surrogate.fitting import fit_target
from learn.surrogate.quantiles import quantile_over_groups
from learn.surrogate.settings import Settings


def of_maps(rows, number):
    """The same rows as if each surface were of one of some maps."""
    maps = tuple(Population("maps.h5", "scans", f"m{each}") for each in range(number))
    return replace(rows, population=rows.groups % number, populations=maps)


@pytest.fixture(scope="module")
def rows(solved):
    return dataset.read(solved, "area", features="dimensionless", roots=True)


def request_of(path, model="kernel-ridge"):
    return Request(
        database=path,
        output=path,
        models=(model,),
        features="dimensionless",
        normalisation="standard",
        roots=True,
    )


@pytest.mark.parametrize("groups", [9, 12, 19])
def test_rows_of_new_groups_are_covered_as_often_as_asked(groups):
    random = np.random.default_rng(5)
    covered = []
    for _ in range(2000):
        sizes = random.lognormal(0.0, 0.7, groups + 1)  # of the errors of each group
        known = tuple(
            np.sort(np.abs(size * random.normal(size=random.integers(5, 40))))
            for size in sizes[:-1]
        )
        covered.append(abs(sizes[-1] * random.normal()) <= quantile_over_groups(known, 0.9))
    slack = 3 * np.sqrt(0.09 / 2000)
    assert 0.9 - slack < np.mean(covered) < 0.9 + 1 / (groups + 1) + slack


def test_a_level_that_the_groups_do_not_reach_has_no_end():
    scores = tuple(np.arange(1.0, 6.0) for _ in range(9))
    assert quantile_over_groups(scores, 0.9) == 5.0
    assert quantile_over_groups(scores, 0.901) == np.inf
    uneven = (np.ones(1000), *(np.full(1, 2.0) for _ in range(9)))
    assert quantile_over_groups(uneven, 0.5) == 2.0, "large groups weigh no more than small ones"


def test_usual_errors_follow_the_features_and_end_at_known_places():
    random = np.random.default_rng(1)
    inputs = np.column_stack([random.uniform(-1, 1, 4000), np.full(4000, 7.0)])
    errors = np.abs(np.exp(1.5 * inputs[:, 0]) * random.normal(size=4000))
    found = fit_scale(inputs, errors, random.integers(0, 10, 4000))
    first, last, beyond = found.at(np.array([[-0.9, 7.0], [0.9, 7.0], [90.0, 7.0]]))
    assert 1.9 < last / first < np.exp(1.8 * 1.5)  # shrunk
    assert beyond < 1.2 * last
    assert (found.at(np.array([[np.nan, 7.0]])) >= last).all()


def test_rows_of_another_kind_are_far_away():
    random = np.random.default_rng(2)
    groups = np.repeat(np.arange(20), 30)
    along = random.normal(size=600)
    inputs = np.column_stack([along, along + 0.05 * random.normal(size=600), np.zeros(600)])
    inputs += 0.1 * random.normal(size=(20, 3))[groups] * [1, 1, 0]
    found = from_training(inputs, groups)
    assert np.mean(found.of(inputs) > found.limit) < 0.1
    odd = np.array([[1.5, -1.5, 0.0]])
    assert (np.abs(odd) < np.abs(inputs).max(axis=0) + 1e-12).all(), "in the range of each feature"
    (said,) = found.noted(odd, ("a note",))
    assert said.startswith("a note; distance from the training")
    assert found.noted(np.zeros((2, 3)), ()) == ("", "")


def test_scheme_and_kind_follow_the_number_of_maps(rows):
    assert by_groups.groups_of(rows) is None
    few, many = (by_groups.groups_of(of_maps(rows, number)) for number in (4, 9))
    assert (few.number, few.kind, few.scheme) == (4, "map", "each")
    assert (many.number, many.kind, many.scheme) == (9, "map", "others")
    two = (Population("a.h5", "rmd"), Population("b.h5", "rmd"))
    pooled = replace(rows, population=rows.rows % 2, populations=two)
    assert by_groups.groups_of(pooled).kind == "database"
    again = tuple(Population(f"{file}.h5", "scans", "m") for file in "ab")
    assert by_groups.groups_of(replace(pooled, populations=again)) is None, "the same map"


@pytest.mark.parametrize(("model", "values"), [("kernel-ridge", {}), ("decision-tree", {})])
@pytest.mark.parametrize("number", [4, 10])
def test_no_row_is_predicted_by_a_model_that_has_seen_its_map(rows, solved, model, values, number):
    train = of_maps(rows, number)
    values = {"kernel": "rbf", "gamma": 0.01, "alpha": 1e-3} if model == "kernel-ridge" else values
    given = Settings(values, False, "given")
    folds = np.zeros(train.size, dtype=np.int8)
    fit = fit_target(request_of(solved, model), train, None, folds, settings=given)
    groups = by_groups.groups_of(train)
    part, unseen = next(by_groups.holdouts(train, by_groups.left_out(train, groups)))
    if number == 10:
        assert np.unique(groups.labels[part]).size == 1
    # Other targets in the part change nothing about its own predictions, but for the scaling.
    spoilt = train.target.copy()
    spoilt[unseen] = np.roll(spoilt[unseen], 1)
    again = fit_target(
        request_of(solved, model), replace(train, target=spoilt), None, folds, settings=given
    )
    np.testing.assert_allclose(again.crossed[part], fit.crossed[part], rtol=1e-6)
    others = np.setdiff1d(np.arange(train.size), part)
    assert not np.allclose(again.crossed[others], fit.crossed[others], rtol=1e-3)


def test_databases_of_the_same_surfaces_are_not_left_out_whole(rows):
    made = of_maps(rows, 9)
    maps = tuple(Population(f"{each}.h5", "rmd") for each in range(9))
    related = replace(made, groups=rows.groups // 30, populations=maps)
    assert by_groups.groups_of(related).scheme == "each"
    alone = replace(related, groups=np.zeros_like(rows.groups))
    assert by_groups.groups_of(alone) is None, "all rows share surfaces"


def test_small_groups_are_joined_where_intervals_hold_for_each():
    labels = np.repeat([0, 1, 2, 3], [60, 7, 9, 50])
    values, sizes = np.unique(by_groups._large(labels), return_counts=True)
    assert sizes.min() >= by_groups.SMALLEST
    assert sizes.sum() == labels.size
    assert values.size == 2


def fitted(solved, number, target="area"):
    request = replace(request_of(solved), targets=(target,))
    sets = [of_maps(rows, number) for rows in training.read(request, None)]
    said = []
    return training.fit_parts(request, sets, split.draw(sets[0]), said.append), said


def test_files_keep_intervals_by_maps(solved, tmp_path):
    surrogate, said = fitted(solved, 10)
    assert any("each predicted without it" in line for line in said)
    surrogate.save(tmp_path / "a.surrogate")
    again = Surrogate.load(tmp_path / "a.surrogate")
    assert again.card["calibration"]["groups"] == 10
    assert again.card["rows"]["calibration"] == again.card["rows"]["train"] == 72
    inputs = surrogate.low + 0.4 * (surrogate.high - surrogate.low)[None, :] * np.ones((3, 1))
    inputs[2] = surrogate.high
    calibration, loaded = (each.learnt["area"].calibration for each in (surrogate, again))
    raw = np.array([1.0, 4.0, 9.0])
    np.testing.assert_array_equal(calibration.ends(raw, 0.9, inputs), loaded.ends(raw, 0.9, inputs))
    np.testing.assert_array_equal(surrogate.distance.of(inputs), again.distance.of(inputs))
    with pytest.raises(ValueError, match="need the features"):
        loaded.ends(raw, 0.9)
    require_level(again.card, again.learnt, 0.9)
    with pytest.raises(InputError, match=r"0.95: intervals of area are calibrated by 10 maps, wh"):
        require_level(again.card, again.learnt, 0.95)


def test_the_card_says_by_what_intervals_are_calibrated(solved, capsys):
    for number, words in {
        10: "intervals calibrated by whole maps (10 of them, each predicted without it): hold for"
        " other maps like these, up to 90.9 %",
        4: "intervals calibrated on each of 4 maps: hold for further surfaces of these maps",
    }.items():
        surrogate, _ = fitted(solved, number)
        training.card.show(surrogate)
        assert words in capsys.readouterr().out
    assert np.isfinite(surrogate.distance.limit)
