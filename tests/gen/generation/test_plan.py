"""The plan: pure in scene and row, and cut into blocks that hold every pending row once."""

import itertools
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gen.generation.plan import SURFACES_PER_STREAM, parameters
from gen.generation.run import BLOCK_BYTES, blocks_of
from gen.scene import Scene, load


def scene(samples=1000, m=1, extra=""):
    return Scene.parse(f"samples = {samples}\nsamples_per_surface = {m}\n{extra}", "test")


def columns(rows):
    return rows.surface, rows.drawn["hurst"], rows.drawn["sigma0"], rows.load


def assert_slice(part, whole, start, stop):
    for column, expected in zip(columns(part), columns(whole), strict=True):
        assert column.shape == (stop - start,)
        np.testing.assert_array_equal(column, expected[start:stop], strict=True)


def test_first_rows_of_the_papers_database():
    """Other numbers here mean that no database made so far can be continued."""
    rows = parameters(load("paper"), 0, 3)
    known = [
        [0, 1, 2],
        [0.7203239930748728, 0.6465117409900214, 0.6770927403352416],
        [12.089954739115084, 10.0545284405591, 10.033495532330592],
        [19.135645934310062, 16.34904294864218, 17.09480985923459],
    ]
    np.testing.assert_allclose(columns(rows), known, rtol=1e-15)


@pytest.mark.parametrize("m", [1, 5])
def test_rows_are_cut_from_streams_drawn_in_full(m):
    paper = scene(m=m)
    for chunk in (0, 3):
        random = np.random.default_rng(
            np.random.SeedSequence(paper.seed, spawn_key=(chunk, 1))
        )
        hurst = 0.5 + (0.8 - 0.5) * random.random(SURFACES_PER_STREAM)
        sigma0 = 10.0 + 5.0 * random.random(SURFACES_PER_STREAM)
        piece, place = np.moveaxis(random.random((SURFACES_PER_STREAM, m, 2)), -1, 0)
        delta = np.where(piece < 0.75, 5.0 + 20.0 * place, 25.0 + 20.0 * place)
        rows = parameters(
            paper, chunk * SURFACES_PER_STREAM * m, (chunk + 1) * SURFACES_PER_STREAM * m
        )
        surface = chunk * SURFACES_PER_STREAM + np.arange(SURFACES_PER_STREAM)
        np.testing.assert_array_equal(rows.surface, np.repeat(surface, m))
        np.testing.assert_array_equal(rows.drawn["hurst"], np.repeat(hurst, m))
        np.testing.assert_array_equal(rows.drawn["sigma0"], np.repeat(sigma0, m))
        np.testing.assert_array_equal(rows.load, delta.ravel())


@pytest.mark.few(2)
@pytest.mark.parametrize("m", [1, 5])
def test_any_slice_equals_the_whole(m):
    stop = 2 * SURFACES_PER_STREAM * m + 100
    whole = parameters(scene(m=m), 0, stop)
    border = SURFACES_PER_STREAM * m
    cuts = [
        0,
        1,
        2,
        m,
        3 * m + 1,
        border - m - 1,
        border - 1,
        border,
        border + 1,
        2 * border,
        stop,
    ]
    for start, end in itertools.combinations_with_replacement(sorted(cuts), 2):
        assert_slice(parameters(scene(m=m), start, end), whole, start, end)


def hardness(limits, m=1, key="hardness"):
    return scene(m=m, extra=f"[contact]\n{key} = {limits}")


def test_first_hardnesses():
    """Other numbers here mean that no database with hardnesses can be continued."""
    rows = parameters(hardness("[0.003, 0.1]", key="hardness_ratio"), 0, 3)
    assert rows.hardness is not None
    expected = [0.07490445338831135, 0.08510671745396003, 0.018759289500291137]
    assert rows.hardness.tolist() == expected


@pytest.mark.parametrize("m", [1, 5])
def test_hardness_shifts_no_other_number(m):
    elastic = parameters(scene(m=m), 7, 500)
    assert elastic.hardness is None
    for limits in ("2000", "[500, 2000]"):
        assert_slice(parameters(hardness(limits, m), 7, 500), elastic, 0, 493)


@st.composite
def pending_plans(draw):
    """Ascending ranges of pending rows, the number of planned rows, and of rows a surface."""
    samples = draw(st.integers(1, 500))
    borders = sorted(draw(st.lists(st.integers(0, samples), max_size=20)))
    pairs = list(itertools.pairwise(borders))[:: draw(st.sampled_from([1, 2]))]
    ranges = [range(start, stop) for start, stop in pairs]
    return ranges, samples, draw(st.sampled_from([1, 2, 5, 7]))


@settings(max_examples=300, deadline=None)
@given(plan=pending_plans(), workers=st.integers(1, 20), largest=st.integers(1, 100))
def test_blocks_hold_every_pending_row_once(plan, workers, largest):
    ranges, _, m = plan
    with mock.patch.multiple("gen.generation.run", BLOCK_ROWS=largest, ANSWER_NODES=0):
        cut = list(blocks_of(scene(m=m), ranges, workers))
    held = [row for block in cut for row in block]
    assert held == sorted(set(held))
    assert held == [row for rows in ranges for row in rows]
    ends = {rows.stop for rows in ranges}
    for block in cut:
        assert block.stop % m == 0 or block.stop in ends or m > largest
        assert 0 < len(block) <= largest


@pytest.mark.parametrize(
    ("workers", "rows", "fewest", "most"),
    [
        (1, 10_000, 1, 64),
        (
            499,
            1_000_000,
            70,
            160,
        ),  # the master has to answer 499 workers in the time of a block
        (
            499,
            10_000,
            25,
            64,
        ),  # 20 rows for each: larger blocks would leave most without any
    ],
)
def test_blocks_grow_with_the_workers_that_one_master_answers(
    workers, rows, fewest, most
):
    paper = load("paper").model_copy(update={"samples": rows})
    sizes = [len(block) for block in blocks_of(paper, [range(rows)], workers)]
    assert sum(sizes) == rows
    assert fewest <= min(sizes[:-1])
    assert max(sizes) <= most


def test_fields_bound_blocks_whatever_the_number_of_workers():
    paper = load("paper")
    store = paper.store.model_copy(update={"pressure": True, "heights": True})
    heavy = paper.model_copy(update={"store": store})
    sizes = [len(block) for block in blocks_of(heavy, [range(heavy.samples)], 5000)]
    assert max(sizes) * 2 * 8 * 129**2 <= BLOCK_BYTES
