"""Two rough bodies: their heights added as they face each other, on one grid, where both are."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import bem
from gen.material import combined_modulus
from gen.measured.composite import Placement, composite
from gen.measured.topography import Topography, intervals
from gen.runtime.errors import InputError

BOUNDARIES = ("free", "periodic", "mirror")


def surface(heights, side=(8.0, 8.0), boundary="free", name="map"):
    return Topography(name, np.asarray(heights, dtype=float), side, boundary=boundary)


def rough(shape, seed=0):
    return np.random.default_rng(seed).normal(size=shape)


def grid(nodes, side, boundary):
    """Coordinates of nodes from the centre of a patch [um]."""
    return (np.arange(nodes) - (nodes - 1) / 2) * side / intervals(nodes, boundary)


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize("turned", ["x", "y", "none"])
def test_a_flat_second_body_changes_no_byte(boundary, turned):
    first = surface(rough((16, 15)), boundary=boundary)
    flat = surface(np.full((16, 15), 1e3 + 0.1), boundary=boundary)
    made = composite(first, flat, Placement(turned))
    assert made.heights.tobytes() == first.heights.tobytes()
    assert (made.sides, made.spacing) == (first.sides, first.spacing)
    own, pair = (bem.solve(each.heights, each.sides, 0.4) for each in (first, made))
    assert pair.pressure.tobytes() == own.pressure.tobytes()


@pytest.mark.parametrize("shape", [(7, 7), (12, 7)])  # a coarser flat body is interpolated
@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_a_flat_second_body_of_another_grid_changes_no_byte(shape, boundary):
    first = surface(rough((16, 15)), boundary=boundary)
    flat = surface(np.full(shape, -0.3), boundary=boundary)
    assert composite(first, flat).heights.tobytes() == first.heights.tobytes()


def test_a_body_faces_the_other_one_with_one_axis_turned():
    first, second = rough((6, 5)), rough((6, 5), 1)
    below = second - second.max()
    for turned, facing in (("x", below[::-1]), ("y", below[:, ::-1]), ("none", below)):
        made = composite(surface(first), surface(second), Placement(turned))
        np.testing.assert_array_equal(made.heights, first + facing)
    default = composite(surface(first), surface(second))
    np.testing.assert_array_equal(default.heights, first + below[::-1])


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
def test_two_equal_waves_are_one_of_double_amplitude(boundary):
    x, y = grid(32, 8.0, boundary), grid(24, 8.0, boundary)
    wave = 0.1 * np.cos(2 * np.pi * x / 8)[:, None] * np.cos(4 * np.pi * y / 8)
    made = composite(surface(wave, boundary=boundary), surface(wave, boundary=boundary))
    np.testing.assert_allclose(
        made.heights - made.heights.max(), 2 * (wave - wave.max()), atol=1e-15
    )
    pair = bem.solve(made.heights, 8.0, pressure=0.05, spacing=made.spacing, boundary=boundary)
    one = bem.solve(2 * wave, 8.0, pressure=0.05, spacing=made.spacing, boundary=boundary)
    assert pair.delta == pytest.approx(one.delta, rel=1e-9)
    assert pair.contact_nodes == one.contact_nodes


@pytest.mark.parametrize("nodes", [(65, 65), (65, 48)])  # of the two bodies
def test_a_sphere_on_a_sphere_is_hertz_with_the_composite_radius(nodes):
    radii, side, delta = (80.0, 120.0), 4.0, 0.004
    bodies = []
    for radius, count in zip(radii, nodes, strict=True):
        x = grid(count, side, "free")
        bodies.append(surface(-(x[:, None] ** 2 + x**2) / (2 * radius), (side, side)))
    made = composite(*bodies)
    modulus = combined_modulus([210e3, 70e3], [0.3, 0.33])
    radius = 1 / (1 / radii[0] + 1 / radii[1])
    x = grid(65, side, "free")
    one = -(x[:, None] ** 2 + x**2) / (2 * radius)
    np.testing.assert_allclose(made.heights - made.heights.max(), one - one.max(), atol=1e-12)
    force = bem.solve(made.heights, made.sides, delta, modulus=modulus).force
    assert force == pytest.approx(4 / 3 * modulus * np.sqrt(radius * delta**3), rel=0.02)


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_the_map_with_the_wider_spacing_is_interpolated(boundary):
    def wave(nodes):
        x, y = (grid(count, 8.0, boundary) for count in nodes)
        return np.cos(2 * np.pi * x / 8)[:, None] + np.sin(2 * np.pi * y / 8) ** 2

    fine, coarse = (72, 80), (40, 36)
    whole = wave(fine)
    for shapes in ((fine, coarse), (coarse, fine)):
        made = composite(*(surface(wave(shape), boundary=boundary) for shape in shapes))
        assert made.heights.shape == fine
        assert made.sides == (8.0, 8.0)
        error = made.heights - made.heights.max() - 2 * (whole - whole.max())
        assert np.abs(error - error.mean()).max() < 3e-4
        number = 2 if shapes[0] == fine else 1
        assert f"body {number} interpolated by cubic splines from nodes every" in made.steps[-1]


def test_a_cubic_surface_is_interpolated_to_rounding():
    def cubic(nodes):
        x = grid(nodes, 8.0, "free") / 8
        return x[:, None] ** 3 - 2 * x[:, None] * x**2 + x

    made = composite(surface(np.zeros((50, 50))), surface(cubic(21)), Placement("none"))
    error = made.heights - cubic(50)
    assert np.ptp(error) < 1e-14


@pytest.mark.parametrize("nodes", [2, 3])
def test_maps_of_two_and_three_lines_are_interpolated(nodes):
    line = surface(np.outer(np.linspace(0, 1, nodes), np.ones(nodes)))
    made = composite(surface(np.zeros((9, 9))), line, Placement("none"))
    np.testing.assert_allclose(made.heights[:, 4], np.linspace(-1, 0, 9), atol=1e-14)


def test_spacings_that_differ_much_are_warned_of():
    first, second = surface(rough((9, 9))), surface(rough((9, 9), 1), (85.0, 85.0))
    for pair in ((first, second), (second, first)):
        (warning,) = composite(*pair).warnings
        assert "10.6 times as far apart" in warning
    assert composite(first, surface(rough((9, 9), 1), (75.0, 75.0))).warnings == ()


def test_a_shift_by_nodes_takes_the_part_that_both_have():
    first, second = rough((9, 9)), rough((9, 9), 1)
    below = second - second.max()
    made = composite(surface(first), surface(second), Placement("none", (2.0, -1.0)))
    np.testing.assert_array_equal(made.heights, first[2:, :-1] + below[:-2, 1:])
    assert made.sides == pytest.approx((6.0, 7.0))
    assert "centre shifted by 2 and -1 um" in made.steps[-1]
    assert "the 6 x 7 um that 8 x 8 and 8 x 8 um share" in made.steps[-1]


def test_a_periodic_body_is_shifted_round():
    first, second = (surface(rough((8, 8), seed), boundary="periodic") for seed in (0, 1))
    made = composite(first, second, Placement("none", (3.0, -21.0)))
    below = second.heights - second.heights.max()
    np.testing.assert_array_equal(made.heights, first.heights + np.roll(below, (3, -21), (0, 1)))
    assert made.sides == (8.0, 8.0)


@pytest.mark.parametrize("nodes", [(9, 6), (6, 9), (8, 5)])
def test_maps_of_one_spacing_are_never_interpolated(nodes):
    first, second = (rough((count, count), seed) for seed, count in enumerate(nodes))
    sides = [(count - 1.0, count - 1.0) for count in nodes]
    bodies = (surface(each, side) for each, side in zip((first, second), sides, strict=True))
    made = composite(*bodies, Placement("none"))
    assert made.heights.shape == (min(nodes),) * 2
    below = second - second.max()
    few = min(nodes)
    sums = [
        (first[i : i + few, i : i + few] + below[j : j + few, j : j + few])
        for i in range(nodes[0] - few + 1)
        for j in range(nodes[1] - few + 1)
    ]
    middle = [np.array_equal(made.heights, each) for each in sums]
    assert sum(middle) == 1
    assert middle.index(True) in {(len(sums) - 1) // 2, len(sums) // 2}


def test_a_small_body_lies_on_the_middle_of_a_large_one():
    first = rough((17, 17))
    second = rough((5, 9), 1)
    made = composite(surface(first, (16.0, 16.0)), surface(second, (4.0, 8.0)), Placement("none"))
    np.testing.assert_allclose(made.heights, first[6:11, 4:13] + second - second.max(), atol=1e-14)
    assert made.spacing == (1.0, 1.0)


sizes = st.integers(5, 14)
lengths = st.floats(3.0, 9.0)


@given(
    shapes=st.tuples(sizes, sizes, sizes, sizes),
    sides=st.tuples(lengths, lengths, lengths, lengths),
    shift=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
    boundary=st.sampled_from(BOUNDARIES),
)
def test_who_is_pressed_against_whom_does_not_matter(shapes, sides, shift, boundary):
    first = surface(rough(shapes[:2]), sides[:2], boundary)
    second = surface(rough(shapes[2:], 1), sides[2:], boundary)
    cells = [np.prod(each.spacing) for each in (first, second)]
    assume(not np.isclose(*cells, rtol=1e-5))  # else the first one's grid is taken
    assume(max(first.spacing + second.spacing) < 0.9)  # two nodes of either lie on both
    made = composite(first, second, Placement("x", shift))
    again = composite(second, first, Placement("x", (shift[0], -shift[1])))
    assert again.sides == pytest.approx(made.sides)
    difference = again.heights[::-1] - made.heights
    assert np.ptp(difference) < 1e-9 * (1 + np.abs(made.heights).max())


def test_bodies_that_do_not_meet_are_refused():
    first, second = surface(rough((9, 9)), name="a"), surface(rough((9, 9)), name="b")
    with pytest.raises(InputError, match="a against b: fewer than 2 x 2 nodes lie on both maps"):
        composite(first, second, Placement("x", (0.0, 8.0)))


def test_heights_that_are_too_large_to_be_added_are_refused():
    huge = surface(1e300 * rough((9, 9)), name="huge")
    for pair in ((huge, surface(rough((9, 9)))), (surface(rough((9, 9))), huge)):
        with pytest.raises(InputError, match="huge: heights of"):
            composite(*pair)


def test_steps_and_warnings_name_their_body():
    first = Topography("a", rough((4, 4)), (3.0, 3.0), ("read",), ("odd",))
    second = Topography("b", rough((4, 4)), (3.0, 3.0), ("read", "filled"), ())
    made = composite(first, second)
    assert made.name == "a against b"
    assert made.steps[:3] == ("body 1: read", "body 2: read", "body 2: filled")
    assert made.steps[3].startswith(
        "pressed against body 2 (b), turned over (its x runs backwards)"
    )
    assert made.warnings == ("body 1: odd",)


@pytest.mark.parametrize(
    ("turned", "shift", "word"),
    [
        *(("z", "", "--turned 'z'"), ("X", "", "--turned"), ("", "5", "--shift '5'")),
        *(("", "a,b", "--shift"), ("", "1,2,3", "--shift"), ("", "inf,0", "--shift")),
    ],
)
def test_placements_that_are_none_are_refused(turned, shift, word):
    with pytest.raises(InputError, match=word):
        Placement.parse(turned, shift)
    assert Placement.parse("", "") == Placement()
    assert Placement.parse("y", "1,-2.5") == Placement("y", (1.0, -2.5))
