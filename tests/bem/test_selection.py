"""Filters of values on some nodes against the same filters of whole fields."""

import numpy as np
import pytest

from bem import vectors
from bem.convolution import displacement_filter
from bem.places import _all_places, node_places, places_and_blocks
from bem.selection import PlainImage, Selection

SHAPE = (12, 17)
ALL = np.arange(SHAPE[0] * SHAPE[1])
RANDOM = np.random.default_rng(3)
NODES = {
    "some": np.flatnonzero(RANDOM.random(ALL.size) < 0.4),
    "all": ALL,
    "all, in another order": RANDOM.permutation(ALL),
}


@pytest.mark.parametrize("cut", [False, True])
@pytest.mark.parametrize("which", NODES)
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_selections_share_a_filter_and_agree_with_it(
    monkeypatch: pytest.MonkeyPatch, dtype: str, which: str, cut: bool
) -> None:
    """In one piece as in many."""
    if cut:
        monkeypatch.setattr(vectors, "PIECE", 16)
        monkeypatch.setattr(vectors, "SHORT", 32)
        monkeypatch.setattr(vectors, "SHARED", 32)
        monkeypatch.setattr("bem.selection.SHORT", 32)
        monkeypatch.setattr("bem.places.SHORT", 32)
    operator = displacement_filter(SHAPE, "uniform-pressure", dtype=dtype)
    nodes = NODES[which]
    some = np.flatnonzero(np.random.default_rng(4).random(nodes.size) < 0.5)
    other, selection = Selection(operator, None), Selection(operator, nodes)
    values = np.random.default_rng(5).standard_normal(nodes.size).astype(dtype)

    def reference(indices: np.ndarray, given: np.ndarray) -> np.ndarray:
        field = np.zeros(SHAPE, dtype)
        field.flat[indices] = given
        return operator(field).reshape(-1)

    other(np.ones(ALL.size, dtype))  # leaves pressure everywhere
    np.testing.assert_array_equal(selection(values), reference(nodes, values)[nodes])
    whole = selection.everywhere(values)
    np.testing.assert_array_equal(whole.reshape(-1), reference(nodes, values))
    for part in (some, slice(None), slice(2, 9)):
        expected = reference(nodes[part], values[part])[nodes].astype(float)
        np.testing.assert_array_equal(selection.spread(part, values[part]), expected)
        target = np.linspace(-1, 1, nodes.size)
        image = selection.image(part, values[part])
        plain = PlainImage(expected, part)
        room = np.empty(values[part].size)
        np.testing.assert_array_equal(image.on_nodes(room), expected[part])
        np.testing.assert_array_equal(plain.on_nodes(room), expected[part])
        summed = target - 0.3 * expected
        for each in (image, plain):
            moved = target.copy()
            each.add_to(moved, -0.3)
            np.testing.assert_array_equal(moved, summed)


@pytest.mark.parametrize("across", [17, 24, 32])
def test_places_and_blocks_are_those_of_the_table(
    monkeypatch: pytest.MonkeyPatch, across: int
) -> None:
    nodes = NODES["some"]
    expected = _all_places(SHAPE, across)[nodes]
    np.testing.assert_array_equal(node_places(SHAPE, across, nodes), expected)
    monkeypatch.setattr(vectors, "SHARED_PIECE", 16)
    monkeypatch.setattr("bem.places.SHORT", 1)
    np.testing.assert_array_equal(node_places(SHAPE, across, nodes), expected)
    places, blocks = places_and_blocks(SHAPE, across, nodes, 4)
    np.testing.assert_array_equal(places, expected)
    rows, columns = np.divmod(expected, across)
    np.testing.assert_array_equal(blocks, rows // 4 * (across // 4) + columns // 4)
