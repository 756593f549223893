"""Spectral surfaces of scenes: what is refused before a run, rms values, windows, any boundary."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gen.generation.plan import parameters
from gen.generation.sample import surface_numbered, surface_of
from gen.runtime.errors import InputError
from gen.scene import Scene

SCENE = """samples = 400
[surface]
generator = "spectral"
nodes = {nodes}
side = {side}
hurst = {hurst}
roll_off = 60.0
cut_off = {cut_off}
{rms}
stretch = {stretch}
{further}
[contact]
boundary = "{boundary}"
"""


def scene(**keys):
    """A scene on 64 x 48 nodes, oblong cells, with some other keys."""
    common = {
        "nodes": [64, 48],
        "side": [200.0, 180.0],
        "hurst": 0.7,
        "cut_off": 12.0,
        "rms": "rms_height = 0.5",
        "stretch": 1.0,
        "further": "",
        "boundary": "periodic",
    }
    return Scene.parse(SCENE.format(**{**common, **keys}), "test")


def surfaces(of, number):
    plan = parameters(of, 0, number)
    return plan, [surface_of(of, plan, row) for row in range(number)]


@pytest.mark.parametrize("boundary", ["free", "mirror"])
def test_windows_have_the_rms_asked_for_in_the_mean(boundary):
    """Mean square differences of neighbours in 200 windows, within 3 % of the period's own."""
    of = scene(boundary=boundary)
    whole = scene(boundary=boundary, further="period = 1.0")
    measured, expected = (
        np.mean([np.mean(np.diff(heights, axis=0) ** 2) for heights in surfaces(each, 200)[1]])
        for each in (of, whole)
    )
    assert measured == pytest.approx(expected, rel=0.03)


def test_opposite_borders_of_a_window_have_nothing_to_do_with_each_other():
    for boundary, related in (("free", False), ("mirror", False), ("periodic", True)):
        _, drawn = surfaces(scene(boundary=boundary), 40)
        borders = np.array([(heights[0], heights[-1]) for heights in drawn])
        correlation = np.corrcoef(borders[:, 0].ravel(), borders[:, 1].ravel())[0, 1]
        assert (correlation > 0.8) == related


def test_the_period_can_be_given():
    for boundary in ("free", "periodic", "mirror"):
        of = scene(boundary=boundary, further="period = 1.0", nodes=32, cut_off=14.0)
        _, drawn = surfaces(of, 2)
        assert [heights.std() for heights in drawn] == pytest.approx([0.5, 0.5], rel=1e-12)


@pytest.mark.parametrize(
    ("keys", "fault"),
    [
        ({"cut_off": 7.4}, "cut_off is from 7.4 um on; this grid holds waves of 7.5 um and more"),
        ({"cut_off": 7.5, "stretch": 0.5}, "waves of 12.5 um"),
        ({"cut_off": 55.0, "side": [40.0, 54.0]}, "the longest wave of the period 54 um"),
        ({"nodes": [4000, 4], "further": "period = 4.5"}, "its period has 18000 x 18 nodes, 4.5"),
        ({"cut_off": 60.0, "nodes": 2, "side": 30.0}, "the longest wave of the period 0 um"),
    ],
)
def test_a_draw_that_cannot_be_made_is_refused_before_the_run(keys, fault):
    with pytest.raises(InputError) as refused:
        scene(**keys)
    assert fault in str(refused.value)
    assert "\n" not in str(refused.value)


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_what_is_not_refused_can_be_made(data):
    """All corners of the distributions, on any grid, for any boundary."""
    draw = data.draw
    numbers = st.floats(0.5, 2.0)
    lows = [draw(numbers) for _ in range(2)]
    highs = [low * draw(numbers) for low in lows]
    cut_off, stretch = ([min(pair), max(pair)] for pair in zip(lows, highs, strict=True))
    cut_off = [10 * length for length in cut_off]
    keys = {
        "nodes": [draw(st.integers(2, 24)), draw(st.integers(2, 24))],
        "side": [draw(st.floats(10.0, 80.0)), draw(st.floats(10.0, 80.0))],
        "boundary": draw(st.sampled_from(["free", "periodic", "mirror"])),
        "further": draw(st.sampled_from(["", "period = 1.0", "period = 1.37"])),
        "hurst": f"{{ choice = {[0.0, 1.0]} }}",
        "cut_off": f"{{ choice = {cut_off} }}",
        "stretch": f"{{ choice = {stretch} }}",
    }
    try:
        of = scene(**keys)
    except InputError:
        return
    for heights in surfaces(of, 12)[1]:
        assert heights.shape == of.shape
        assert np.isfinite(heights).all()


def test_surfaces_beyond_double_precision_are_refused_in_words():
    with pytest.raises(InputError, match="surface 3 cannot be made in double precision"):
        surface_numbered(scene(rms="rms_height = 1e300"), 3)
