"""The holdout of a growth: a fixed share of whole groups, which no growth changes."""

from dataclasses import replace

import numpy as np
import pytest

from gen.runtime.errors import InputError
from learn import dataset
from learn.grow import holdout


def test_one_of_five_successive_numbers_is_drawn_by_the_seed_alone():
    drawn = holdout.drawn(np.arange(1000), 7)
    assert (drawn.reshape(-1, 5).sum(axis=1) == 1).all()
    assert (drawn != holdout.drawn(np.arange(1000), 8)).any()
    some = np.random.default_rng(0).permutation(1000)[:300]
    np.testing.assert_array_equal(holdout.drawn(some, 7), drawn[some])
    places = np.flatnonzero(drawn) % 5
    assert (np.bincount(places, minlength=5) > 20).all()  # random, not every fifth


@pytest.mark.parametrize("rows", [30, 61, 89])
def test_a_larger_database_holds_out_the_same_rows(solved, rows):
    whole = dataset.read(solved)
    test, train = holdout.split_holdout(whole)
    some = whole.at(np.arange(rows))
    test_then, train_then = holdout.split_holdout(some)
    np.testing.assert_array_equal(test_then, test[:rows])
    np.testing.assert_array_equal(train_then, train[:rows])
    assert test.sum() == whole.size // 5


def test_windows_of_one_tile_are_in_one_part(populations):
    rows = dataset.read(populations / "scans.h5", "area")
    test, train = holdout.split_holdout(rows)
    assert rows.by_tile
    assert test.any()
    assert train.any()
    assert not set(rows.groups[test]) & set(rows.groups[train])


def test_rows_that_repeat_a_surface_follow_its_first_row(populations):
    rows = dataset.read(populations / "python.h5", "area")
    repeated = replace(rows, groups=np.arange(rows.size) % 20)
    test, train = holdout.split_holdout(repeated)
    for group in range(20):
        assert len(set(test[repeated.groups == group])) == 1
    assert (train == ~test).all()


def test_rows_linked_to_rows_of_the_holdout_train_never_and_test_no_more(populations):
    rows = dataset.read(populations / "scans.h5", "area")
    test, _ = holdout.split_holdout(rows)
    linked = replace(rows, groups=np.zeros(rows.size, dtype=np.int64))
    test_then, train_then = holdout.split_holdout(linked)
    np.testing.assert_array_equal(test_then, test)
    assert not train_then.any()


def test_parts_are_whole_groups_in_random_order_with_folds(solved):
    rows = dataset.read(solved)
    parts = holdout.parted([rows], seed=3)
    assert sorted([*parts.train, *parts.test]) == list(range(rows.size))
    assert set(parts.folds) == set(range(5))
    assert (np.diff(parts.folds) >= 0).all()
    assert list(parts.train) != sorted(parts.train)
    other = holdout.parted([rows], seed=4)
    np.testing.assert_array_equal(other.test, parts.test)
    assert list(other.train) != list(parts.train)


def test_rows_of_one_surface_are_drawn_one_by_one(solved):
    rows = dataset.read(solved)
    same = replace(rows, groups=np.zeros(rows.size, dtype=np.int64))
    parts = holdout.parted([same], seed=0)
    assert 10 < parts.test.size < 26
    assert not parts.by_surface


def test_parts_without_a_test_row_are_refused(solved):
    rows = dataset.read(solved)
    test, _ = holdout.split_holdout(rows)
    with pytest.raises(InputError, match="over the 0 test rows"):
        holdout.parted([rows.at(np.flatnonzero(~test))], seed=0)
