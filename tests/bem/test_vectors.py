"""Passes over long vectors, piece by piece, against the plain expressions."""

import numpy as np
import pytest

from bem import vectors
from bem.workers import on_threads


def cut_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut vectors of 16 entries, and on several threads those of 10, into pieces."""
    for name, entries in {"PIECE": 8, "SHORT": 16, "SHARED": 10, "SHARED_PIECE": 4}.items():
        monkeypatch.setattr(vectors, name, entries)


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("size", [1, 9, 10, 15, 16, 17, 100])
def test_passes_in_pieces_are_the_plain_expressions(
    monkeypatch: pytest.MonkeyPatch, size: int, threads: int
) -> None:
    cut_short(monkeypatch)
    random = np.random.default_rng(size)
    a, b = random.standard_normal((2, size))
    field = random.standard_normal(3 * size).astype(np.float32)
    nodes = np.sort(random.choice(3 * size, size, replace=False))
    with on_threads(threads):
        np.testing.assert_array_equal(vectors.take(field, nodes), field[nodes])
        as_double = vectors.take(field, nodes, np.empty(size))
        np.testing.assert_array_equal(as_double, field[nodes].astype(float))
        moved, left = np.empty(size), field.copy()
        vectors.take_out(left, nodes, moved)
        np.testing.assert_array_equal(moved, field[nodes])
        assert not left[nodes].any()
        vectors.put(moved, nodes, left)
        np.testing.assert_array_equal(left, field)
        vectors.clear(left)
        assert not left.any()
        target = a.copy()
        vectors.add_taken(target, field, nodes)
        np.testing.assert_array_equal(target, a + field[nodes])
        target = a.copy()
        vectors.add_scaled(target, 0.3, b)
        np.testing.assert_array_equal(target, a + 0.3 * b)
        vectors.scale_and_add(target, 0.7, b)
        np.testing.assert_array_equal(target, 0.7 * (a + 0.3 * b) + b)
        np.testing.assert_array_equal(vectors.combined(np.subtract, a, b), a - b)
        vectors.keep_positive(target)
        assert target.min() >= 0
        assert vectors.largest_magnitude(a) == np.abs(a).max()
        assert vectors.anywhere(lambda piece: a[piece] == a[-1], size)
        assert not vectors.anywhere(lambda piece: a[piece] > 99, size)
        np.testing.assert_array_equal(
            vectors.where(lambda piece: a[piece] > 0, size), np.flatnonzero(a > 0)
        )
        assert vectors.where(lambda piece: a[piece] > 99, size).size == 0
        both = vectors.joined(nodes, nodes[:3])
        np.testing.assert_array_equal(both, np.concatenate([nodes, nodes[:3]]))


def test_a_nan_is_the_largest_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    cut_short(monkeypatch)
    for place in (0, 20, 39):
        values = np.arange(40.0)
        values[place] = np.nan
        assert np.isnan(vectors.largest_magnitude(values))


@pytest.mark.parametrize("size", [0, 1, 7, 8, 100])
def test_sums_of_pieces_are_added_in_their_order(
    monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    cut_short(monkeypatch)
    values = np.random.default_rng(size).standard_normal(size)
    found = []
    for threads in (1, 3):
        with on_threads(threads):
            found.append(vectors.sum_of(lambda piece: float(values[piece].sum()), size))
    assert found[0] == found[1]
    assert found[0] == pytest.approx(float(values.sum()), rel=1e-14, abs=1e-14)
