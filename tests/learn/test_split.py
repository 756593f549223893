"""The split: sizes, surfaces, folds, seeds."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen.runtime.errors import InputError
from gen.scene import load
from learn import split
from learn.database_rows import Dataset, Origin
from learn.features.sets import OfSurface


def rows_of(sizes, seed=0):
    """A dataset whose surfaces have these numbers of samples."""
    groups = np.repeat(np.arange(len(sizes)), sizes)
    groups = np.random.default_rng(seed).permutation(groups)
    size = groups.size
    inputs = np.random.default_rng(seed).normal(size=(size, 3))
    return Dataset(
        inputs=inputs,
        target=inputs[:, 0],
        rows=np.arange(size),
        groups=groups,
        database=np.zeros(size, dtype=np.int64),
        population=np.zeros(size, dtype=np.int64),
        features=OfSurface("three", ("a", "b", "c"), "none"),
        target_name="area_percent",
        unit="%",
        dropped={},
        described=inputs,
        scale=np.ones(size),
        origins=(Origin("x.h5", "", load("paper"), size),),
        name="x.h5",
    )


def test_sizes_are_the_papers():
    drawn = split.draw(rows_of([1] * 15878))
    assert (drawn.train.size, drawn.test.size) == (12703, 3175)
    assert np.ptp(np.bincount(drawn.folds)) <= 1


@given(st.lists(st.integers(1, 9), min_size=12, max_size=60), st.integers(0, 99))
def test_surfaces_stay_together_and_rows_are_used_once(sizes, seed):
    rows = rows_of(sizes, seed)
    drawn = split.draw(rows, seed)
    together = np.concatenate([drawn.train, drawn.test])
    np.testing.assert_array_equal(np.sort(together), np.arange(rows.size))
    assert not set(rows.groups[drawn.train]) & set(rows.groups[drawn.test])
    for fold in range(split.FOLDS):
        inside, outside = (
            drawn.train[drawn.folds == fold],
            drawn.train[drawn.folds != fold],
        )
        assert not set(rows.groups[inside]) & set(rows.groups[outside])
    assert abs(drawn.test.size - 0.2 * rows.size) <= 9 + 1


def test_windows_of_a_single_tile_are_refused():
    one = replace(rows_of([40]), by_tile=True)
    with pytest.raises(
        InputError, match="lie in 1 of the maps' tiles, 2 at least are needed"
    ):
        split.draw(one)


def test_windows_of_fewer_tiles_than_needed_are_refused():
    three = replace(rows_of([40, 40, 40]), by_tile=True)
    with pytest.raises(InputError, match="lie in 3 of the maps' tiles, 4 at least"):
        split.require_tiles(three, 4)


def test_surfaces_that_are_no_windows_need_no_tiles():
    split.require_tiles(rows_of([40]), 4)


def test_a_seed_gives_the_same_split_another_one_another():
    rows = rows_of([1] * 50)
    first, again, other = split.draw(rows, 1), split.draw(rows, 1), split.draw(rows, 2)
    np.testing.assert_array_equal(first.train, again.train)
    np.testing.assert_array_equal(first.folds, again.folds)
    assert (first.train != other.train).any()


def test_rows_of_a_single_surface_are_split_one_by_one():
    drawn = split.draw(rows_of([40]))
    assert not drawn.by_surface
    assert drawn.test.size == 8


def test_a_single_training_row_is_refused():
    with pytest.raises(InputError, match="--train-rows 1"):
        split.draw(rows_of([1] * 20), 0, 1)


def test_a_single_row_in_a_part_is_refused():
    with pytest.raises(InputError, match="does not vary"):
        split.draw(rows_of([19, 1]), 1)


def test_folds_of_a_single_row_are_refused():
    with pytest.raises(InputError, match="5 folds of 2 rows"):
        split.check_folds(rows_of([1] * 10), split.draw(rows_of([1] * 10)))
    split.check_folds(rows_of([1] * 13), split.draw(rows_of([1] * 13)))


def few(rows, number):
    """The same rows with a target that is 0 but on a few surfaces, as where few bodies yield."""
    return replace(rows, target=np.where(rows.groups < number, 1.0 + rows.groups, 0.0))


@given(st.integers(3, 9), st.integers(20, 60), st.integers(0, 99))
def test_every_target_varies_in_every_part(number, surfaces, seed):
    """A target that few surfaces have is in training and test rows, whichever target is first."""
    rows = rows_of([2] * surfaces)
    rare = few(rows, number)
    for drawn in (
        split.draw(rows, seed, further_targets=[rare]),
        split.draw(rare, seed, further_targets=[rows]),
    ):
        for part in (drawn.train, drawn.test):
            assert np.ptp(rare.target[part]) > 0
            assert np.ptp(rows.target[part]) > 0


def test_a_target_that_no_split_can_have_in_both_parts_is_named():
    rows = rows_of([2] * 30)
    rare = replace(few(rows, 1), target_name="yielded_percent")
    with pytest.raises(InputError, match="yielded_percent does not vary over the"):
        split.draw(rows, 0, further_targets=[rare])
    drawn = split.draw(rows)
    with pytest.raises(
        InputError, match=r"yielded_percent is 0 in all \d+ rows of a fold"
    ):
        split.check_folds(rare, drawn)
