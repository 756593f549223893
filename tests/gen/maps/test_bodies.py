"""Two rough bodies: their heights added as they face each other, on one grid, where both are."""

import csv
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gen import cli
from gen.maps.bodies import Opposite, composite
from gen.maps.read import Topography
from gen.maps.settings import Reading
from gen.options import Against
from gen.runtime.errors import InputError

BOUNDARIES = ("free", "periodic", "mirror")


def surface(heights, side=(8.0, 8.0), boundary="free", name="map"):
    return Topography(name, np.asarray(heights, dtype=float), side, boundary=boundary)


def rough(shape, seed=0):
    return np.random.default_rng(seed).normal(size=shape)


def grid(nodes, side, boundary):
    """Coordinates of nodes from the centre of a patch [um]."""
    return (np.arange(nodes) - (nodes - 1) / 2) * side / (nodes - (boundary == "free"))


def test_a_body_faces_the_other_one_with_one_axis_turned():
    first, second = rough((6, 5)), rough((6, 5), 1)
    below = second - second.max()
    for turned, facing in (("x", below[::-1]), ("y", below[:, ::-1]), ("none", below)):
        both = composite(surface(first), surface(second), turned)
        np.testing.assert_array_equal(both.heights, first + facing)
    default = composite(surface(first), surface(second))
    np.testing.assert_array_equal(default.heights, first + below[::-1])


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_the_map_with_the_wider_spacing_is_interpolated(boundary):
    def wave(nodes):
        x, y = (grid(count, 8.0, boundary) for count in nodes)
        return np.cos(2 * np.pi * x / 8)[:, None] + np.sin(2 * np.pi * y / 8) ** 2

    fine, coarse = (72, 80), (40, 36)
    whole = wave(fine)
    for shapes in ((fine, coarse), (coarse, fine)):
        both = composite(*(surface(wave(shape), boundary=boundary) for shape in shapes))
        assert both.heights.shape == fine
        assert both.sides == (8.0, 8.0)
        error = both.heights - both.heights.max() - 2 * (whole - whole.max())
        assert np.abs(error - error.mean()).max() < 3e-4
        number = 2 if shapes[0] == fine else 1
        assert (
            f"body {number} interpolated by cubic splines from nodes every"
            in both.steps[-1]
        )


def test_a_periodic_body_is_shifted_round():
    first, second = (surface(rough((8, 8), seed), boundary="periodic") for seed in (0, 1))
    both = composite(first, second, "none", (3.0, -21.0))
    below = second.heights - second.heights.max()
    np.testing.assert_array_equal(
        both.heights, first.heights + np.roll(below, (3, -21), (0, 1))
    )
    assert both.sides == (8.0, 8.0)


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
    both = composite(first, second, "x", shift)
    again = composite(second, first, "x", (shift[0], -shift[1]))
    assert again.sides == pytest.approx(both.sides)
    difference = again.heights[::-1] - both.heights
    assert np.ptp(difference) < 1e-9 * (1 + np.abs(both.heights).max())


@pytest.mark.parametrize(
    ("turned", "shift", "word"),
    [("z", "", "--turned 'z'"), ("", "5", "--shift '5'"), ("", "inf,0", "--shift")],
)
def test_placements_that_are_none_are_refused(turned, shift, word):
    with pytest.raises(InputError, match=word):
        Against(Path("b.npy"), None, turned, shift).second_body(Reading())


def test_a_second_body_is_turned_about_x_and_centred_unless_it_is_placed():
    path = Path("b.npy")
    first = Reading()
    assert Against(path).second_body(first) == Opposite(path, first)
    placed = Against(path, None, "y", "1,-2.5").second_body(first)
    assert placed == Opposite(path, first, "y", (1.0, -2.5))


@pytest.fixture(autouse=True)
def work(here):
    for seed, name in enumerate(("a", "b")):
        np.save(f"{name}.npy", np.random.default_rng(seed).normal(size=(17, 17)))


def prepared(*arguments):
    assert cli.main(["describe", *arguments, "--csv", "out.csv"]) == 0
    with Path("out.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    return row["prepared"]


def test_both_bodies_are_prepared_alike_unless_the_second_has_options_of_its_own():
    options = ["a.npy", "--side", "16", "--level", "plane", "--against", "b.npy"]
    alike = prepared(*options)
    own = prepared(*options, "--against-options", "--side 8 --invert --downsample 2")
    assert "body 2: levelled by a plane" in alike
    assert "body 2: levelled" not in own
    for words in (
        "body 1: levelled by a plane",
        "body 2: turned",
        "body 2: downsampled to 8 x 8",
    ):
        assert words in own


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ("--side '", "quotation"),
        ("--side 16 --boundary mirror", "--boundary"),
        ("--side 16 --form two", "--form"),
        ("", "after '--against-options' is empty"),
    ],
)
def test_bad_options_of_the_second_body_are_one_line(refused, options, word):
    arguments = ["describe", "a.npy", "--side", "16", "--against", "b.npy"]
    assert word in refused(cli, *arguments, "--against-options", options)


@pytest.mark.filterwarnings("ignore:Cannot close a netcdf_file:RuntimeWarning")
@pytest.mark.parametrize("periodic", [True, False])
def test_a_file_that_calls_itself_periodic_is_told_how_it_is_taken(periodic, capsys):
    library = pytest.importorskip(
        "SurfaceTopography", reason="needs the extra instruments"
    )
    wave = np.cos(2 * np.pi * np.arange(24) / 24)[:, None] * np.cos(
        np.pi * np.arange(20) / 5
    )
    made = library.Topography(0.1 * wave, (24.0, 20.0), unit="um", periodic=periodic)
    made.to_netcdf("map.nc")
    commands = (["contact", "map.nc", "--delta", "0.05"], ["describe", "map.nc"])
    law = ["law", "map.nc", "--delta", "0.05"]
    for options, told in (
        ([], periodic),
        (["--boundary", "mirror"], periodic),
        (["--boundary", "periodic"], False),
        (["--crop", "0:12,0:12"], False),
    ):
        for command in (*commands, law):
            assert cli.main([*command, *options]) == 0
            said = capsys.readouterr().err
            taken = "mirror" if options[1:] == ["mirror"] or command is law else "free"
            line = f"says that its map is periodic, and it is taken as a {taken} patch: --boundary"
            assert (
                f"{line} periodic of gen describe, contact and law follows the file"
                in said
            ) == told
