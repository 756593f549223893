"""Holes, levels, crops: what they leave as it is, what they change; and Hertz from a scan."""

from contextlib import redirect_stdout
from dataclasses import dataclass, fields, replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen import cli
from gen.generators.scans import PreparationTable, ReadingTable
from gen.maps.filters import (
    filled_harmonically,
    filtered,
    is_same,
    resampled,
    without_form,
)
from gen.maps.prepare import STEPS as TAKEN
from gen.maps.prepare import downsampled, least_squares, masked, prepare, surface_warnings
from gen.maps.read import Topography
from gen.maps.settings import KEYS, Reading, as_option, keys
from gen.material import combined_modulus
from gen.runtime.errors import InputError
from gen.spectral import SelfAffineSpectrum, generate_spectral
from gen.surface import generate

X, Y = np.meshgrid(np.arange(12) * 2.0, np.arange(9) * 0.5, indexing="ij")  # um
SIDES = (22.0, 4.0)


def topography(heights, sides=SIDES):
    return Topography("scan", heights, sides)


def shaped(shape, spacing, height, boundary="free"):
    """A map of a function of x and y [um]."""
    x, y = (step * np.arange(nodes) for nodes, step in zip(shape, spacing, strict=True))
    sides = tuple(
        step * (nodes - (boundary == "free"))
        for nodes, step in zip(shape, spacing, strict=True)
    )
    return Topography("map", height(x[:, None], y[None, :]), sides, (), (), boundary)


def spaced(heights, boundary="free"):
    """A map with a spacing of 0.5 x 2 um."""
    return shaped(heights.shape, (0.5, 2.0), lambda *_: heights, boundary)


@given(st.integers(0, 2**32 - 1), st.floats(0.05, 0.9))
def test_filling_keeps_what_was_measured_and_stays_within_its_range(seed, share):
    random = np.random.default_rng(seed)
    heights = random.normal(size=(8, 11))
    measured = random.random(heights.shape) > share
    measured[random.integers(8), random.integers(11)] = True
    filled = filled_harmonically(np.where(measured, heights, np.nan), (2.0, 0.5))
    assert np.array_equal(filled[measured], heights[measured])
    rounding = 1e-9
    assert filled.max() <= heights[measured].max() + rounding
    assert filled.min() >= heights[measured].min() - rounding


@pytest.mark.parametrize(
    ("level", "shape"),
    [
        ("plane", 4 + 0.1 * X - 0.3 * Y),
        ("quadratic", 4 + 0.1 * X - 0.3 * Y + 0.02 * X * Y + 0.01 * X**2 - 0.2 * Y**2),
    ],
)
def test_a_level_takes_its_shape_away_whatever_is_missing(level, shape):
    holes = shape.copy()
    holes[4, 4] = holes[0, 8] = np.nan
    levelled = prepare(topography(holes), Reading(level=level, fill=True))
    np.testing.assert_allclose(levelled.heights, 0, atol=1e-11)
    assert any(level in step for step in levelled.steps)


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
def test_a_crop_without_edges_keeps_the_pixels(boundary):
    heights = np.add.outer(np.arange(10.0), 3 * np.arange(8.0))
    whole = Topography("scan", heights, (20.0, 4.0), boundary=boundary)
    tilt = least_squares(whole).tilt
    assert (tilt.x, tilt.y) == pytest.approx((0.5, 6.0))
    part = prepare(whole, Reading(crop="4:12,1:3"))
    assert part.heights.shape == (5, 5)
    assert part.sides == (10.0, 2.5)
    assert part.spacing == whole.spacing == (2.0, 0.5)
    assert part.boundary == boundary


@pytest.fixture(scope="module")
def prepared():
    """A map upside down after all steps: with a spike, a height out of range, holes and a form."""
    random = np.random.default_rng(0)
    x, y = np.meshgrid(np.arange(41.0), np.arange(33.0), indexing="ij")
    heights = -(2 + 0.1 * x - 0.02 * y + 1e-4 * x**3) + random.normal(0, 0.01, x.shape)
    heights[10, 12] -= 50  # masked: it is below -40
    heights[20, 8] += 9  # a spike
    heights[30:33, 20:24] = np.nan
    settings = Reading(
        crop="0:39,0:32",
        invert=True,
        mask=":40",
        despike=12,
        form=3,
        fill=True,
        filter="4:30",
        downsample=3,
    )
    return prepare(topography(heights, (40.0, 32.0)), settings)


def test_steps_are_taken_in_their_order_whatever_is_asked_for(prepared):
    assert [step.split()[0].strip(":") for step in prepared.steps] == [
        "cropped",
        "turned",
        "masked",
        "despiked",
        "form",
        "filled",
        "filtered",
        "downsampled",
    ]


@pytest.mark.parametrize(
    "words",
    [
        "masked 1 node ",
        "despiked: 1 node ",
        "filled 13 nodes",
        "13 x 11 means of 3 x 3",
    ],
)
def test_steps_say_how_many_nodes_they_change(words, prepared):
    assert any(words in step for step in prepared.steps)


def test_all_steps_leave_the_noise_alone(prepared):
    assert np.abs(prepared.heights).max() < 0.02
    assert prepared.spacing == pytest.approx((3, 3))


@pytest.mark.parametrize("seed", range(2))
def test_spikes_are_told_from_peaks(seed):
    rough = generate("diamond-square", 65, 0.65, 12.5, np.random.default_rng(seed))
    surface = topography(rough, (1000.0, 1000.0))
    assert not prepare(surface, Reading()).warnings
    spiked = rough.copy()
    spiked[30, 20] = rough.max() + 60
    [warning] = prepare(replace(surface, heights=spiked), Reading()).warnings
    assert "(30, 20) is a spike" in warning


def rough(nodes=64, *, tilt=0.0, spike=0):
    """A rough map, perhaps on a slope and with a spike of that many nodes a side."""
    spectrum = SelfAffineSpectrum(0.8, nodes / 6, 4.0)
    heights = generate_spectral(
        (nodes, nodes), float(nodes), spectrum, np.random.default_rng(7), rms_height=0.3
    )
    heights = heights + tilt * np.arange(float(nodes))[:, None]
    heights[20 : 20 + spike, 30 : 30 + spike] += 40.0
    if spike:
        heights[20, 30] += 40.0
    return Topography("map", heights, (float(nodes), float(nodes)))


@pytest.mark.parametrize(
    ("tilt_x", "level", "boundary"),
    [
        (0.15, "", "free"),
        (-0.15, "mean", "periodic"),
        (0.15, "plane", "mirror"),
        (0.0, "", "free"),
    ],
)
def test_a_tilted_map_is_told_with_what_levels_it(tilt_x, level, boundary):
    surface = prepare(
        replace(rough(tilt=tilt_x), boundary=boundary), Reading(level=level)
    )
    told = [line for line in surface_warnings(surface) if "tilted by" in line]
    assert len(told) == (tilt_x != 0 and level in {"", "mean"})
    for line in told:
        along_x = float(line.removeprefix("tilted by ").split()[0])
        assert along_x == pytest.approx(tilt_x, abs=0.005)
        assert "--level plane takes the tilt out" in line
        assert not [each for each in surface_warnings(surface) if "--boundary" in each]


@pytest.mark.long
def test_surfaces_without_a_roll_off_are_not_called_tilted():
    for seed in range(100):
        fractal = generate("diamond-square", 65, 0.8, 12.5, np.random.default_rng(seed))
        assert not prepare(topography(fractal, (1000.0, 1000.0)), Reading()).warnings


STEPS: list[dict[str, Any]] = [
    {},
    {"despike": 7.0},
    {"despike": 20.0},
    {"crop": "10:35,10:35"},
    {"level": "plane"},
    {"form": 2},
]


@pytest.mark.parametrize("boundary", ["free", "periodic"])
@pytest.mark.parametrize("scale", [1.0, 1e-6])
def test_no_warning_advises_what_the_command_follows(scale, boundary):
    advice = 0
    for unit, spike in (("", 3), ("um", 1)):
        made = rough(40, tilt=0.3, spike=spike)
        made = replace(made, heights=scale * made.heights, boundary=boundary, unit=unit)
        for step in STEPS:
            settings = Reading(**step)
            lines = " ".join(surface_warnings(prepare(made, settings)))
            advice += "--" in lines
            assert not (settings.crop and "--crop" in lines)
            assert not ((settings.despike or 99) <= 7 and "--despike 7" in lines)
            assert not ((settings.form or settings.level) and "--level plane" in lines)
            assert f"--boundary {boundary}" not in lines
            assert not (unit and "--unit" in lines)
    assert advice > 0


def test_heights_in_metres_are_told_unless_their_distance_is_wrong():
    rough = generate("diamond-square", 33, 0.65, 2.0, np.random.default_rng(0))
    [warning] = surface_warnings(topography(1e-6 * rough, (100.0, 100.0)))
    assert "in metres: --unit" in warning
    assert "between nodes 3.12 um apart" in warning
    assert not surface_warnings(topography(rough, (1e7, 1e7)))  # reading says that


def with_holes(share):
    """A plane of which a share is missing."""
    missing = np.random.default_rng(1).random(X.shape) < share
    return topography(np.where(missing, np.nan, 0.1 * X))


@pytest.mark.parametrize(("share", "warned"), [(0.05, False), (0.3, True)])
def test_many_holes_are_warned_of(share, warned):
    filled = prepare(with_holes(share), Reading(fill=True))
    warnings = " ".join(surface_warnings(filled))
    assert ("were missing and are filled" in warnings) == warned


def test_more_holes_than_heights_are_refused():
    with pytest.raises(
        InputError, match=r"are missing \(.* %\): .* insist by --fill-most"
    ):
        prepare(with_holes(0.8), Reading(fill=True))


def test_who_insists_has_more_holes_than_heights_filled_with_a_warning():
    filled = prepare(with_holes(0.8), Reading(fill=True, fill_most=True))
    assert "were missing and are filled" in " ".join(surface_warnings(filled))


MODULI = ["--young", "210e3", "--poisson", "0.3", "--young", "70e3", "--poisson", "0.33"]


@dataclass(frozen=True, eq=False)
class Sphere:
    """A scanned sphere that is pressed under three displacements."""

    command: list[str]  # without the load
    printed: str
    rows: pd.DataFrame
    picture: Path


@pytest.fixture(scope="module")
def sphere(tmp_path_factory):
    """R = 5 mm on 160 x 120 um: tilted, noisy, 2 % missing and a hole; heights in nm."""
    folder = tmp_path_factory.mktemp("sphere")
    random = np.random.default_rng(0)
    x, y = np.meshgrid(
        np.linspace(-80, 80, 161), np.linspace(-60, 60, 161), indexing="ij"
    )
    heights = -(x**2 + y**2) / (2 * 5000.0) + 0.01 * x - 0.004 * y
    heights += random.normal(0, 2e-4, x.shape)
    heights[random.random(x.shape) < 0.02] = np.nan
    heights[30:40, 100:115] = np.nan
    np.save(folder / "sphere.npy", 1e3 * heights)
    reading = ["--side", "160,120", "--unit", "nm", "--level", "plane", "--fill"]
    table = folder / "law.csv"
    picture = folder / "law.png"
    command = ["contact", str(folder / "sphere.npy"), *reading, *MODULI]
    outputs = ["--csv", str(table), "--plot", str(picture)]
    printed = StringIO()
    with redirect_stdout(printed):
        assert cli.main([*command, "--delta", "0.1:0.3:3", *outputs]) == 0
    return Sphere(command, printed.getvalue(), pd.read_csv(table), picture)


def test_a_scanned_sphere_is_hertz(sphere):
    modulus = combined_modulus([210e3, 70e3], [0.3, 0.33])
    hertz = 4 / 3 * modulus * np.sqrt(5000.0) * sphere.rows.delta_um**1.5
    np.testing.assert_allclose(sphere.rows.force_uN, hertz, rtol=0.02)


def test_the_preparation_of_a_sphere_is_printed_and_written(sphere):
    assert "filled" in sphere.printed
    assert sphere.rows.prepared.str.contains("levelled by a plane").all()


def test_the_law_of_a_sphere_is_drawn(sphere):
    assert sphere.picture.stat().st_size > 10_000


def test_the_forces_of_a_sphere_give_its_displacements_back(sphere, tmp_path):
    table = tmp_path / "law.csv"
    loads = f"{sphere.rows.force_uN[0]}:{sphere.rows.force_uN[2]}:2"
    assert cli.main([*sphere.command, "--force", loads, "--csv", str(table)]) == 0
    np.testing.assert_allclose(pd.read_csv(table).delta_um, [0.1, 0.3], rtol=1e-4)


@given(
    st.integers(4, 30),
    st.integers(4, 30),
    st.sampled_from(["free", "periodic", "mirror"]),
    st.integers(0, 2**32 - 1),
)
def test_means_of_blocks_are_exact(nx, ny, boundary, seed):
    nodes = 2 + seed % (min(nx, ny) // 2 - 1)
    heights = np.random.default_rng(seed).integers(-512, 512, (nx, ny)).astype(float)
    coarse = downsampled(spaced(heights, boundary), nodes)
    assert coarse.heights.shape == (nx // nodes, ny // nodes)
    for (i, j), mean in np.ndenumerate(coarse.heights):
        block = heights[i * nodes : (i + 1) * nodes, j * nodes : (j + 1) * nodes]
        assert mean == block.sum() / nodes**2
    assert coarse.spacing == pytest.approx((0.5 * nodes, 2.0 * nodes))
    assert coarse.boundary == boundary
    assert ("left out" in coarse.steps[-1]) == bool(nx % nodes or ny % nodes)


def test_a_cut_off_of_four_spacings_is_one_though_lengths_are_rounded():
    """0.7 - 0.3 is less than 0.4 by rounding, and an instrument's spacing may be too."""
    heights = np.random.default_rng(0).normal(size=(30, 30))
    cut = replace(spaced(heights), sides=(29 * 0.1 * (1 + 1e-15), 29 * 0.1))
    assert "S-filter 0.4 um" in filtered(cut, 0.4, None).steps[-1]
    with pytest.raises(InputError, match=r"0\.399 um, is outside 0\.4 to 2\.9 um"):
        filtered(cut, 0.399, None)


def cubic(x, y):
    return 1 + x - 0.5 * y + 0.1 * x * y**2 - 0.02 * x**3


def plane():
    """A map of 9 x 7 nodes."""
    return spaced(np.add.outer(np.arange(9.0), np.arange(7.0)))


UNSUITABLE = {
    "3 nodes along an axis, resampling needs 4": lambda: resampled(
        shaped((3, 9), (1.0, 1.0), cubic), (0.5, 1.0)
    ),
    "a spacing of 7 um leaves 1 x 1 nodes": lambda: resampled(
        shaped((9, 9), (1.0, 1.0), cubic), (7.0, 7.0)
    ),
    "map: --mask 50:60 leaves no height, they are 0 to 14": lambda: masked(
        plane(), 50, 60
    ),
    "map: --downsample 4 leaves fewer than 2 x 2 of 9 x 7": lambda: downsampled(
        plane(), 4
    ),
    "map: --form 7 has 36 coefficients, too many for 63 hei": lambda: without_form(
        plane(), 7
    ),
}


@pytest.mark.parametrize("message", UNSUITABLE)
def test_steps_that_do_not_suit_the_map_are_refused(message):
    with pytest.raises(InputError, match=message):
        UNSUITABLE[message]()


@pytest.mark.parametrize("cutoffs", [(1.0, None), (None, 9.0), (9.0, None)])
def test_cut_offs_that_do_not_suit_the_map_are_refused(cutoffs):
    with pytest.raises(
        InputError, match=r"-filter's cut-off, .* um, is outside 8 to 4 um, fo"
    ):
        filtered(plane(), *cutoffs)


def test_coarser_nodes_are_means_of_a_cubic_over_their_cells():
    coarse = resampled(shaped((41, 41), (1.0, 1.0), cubic), (2.5, 4.0))
    assert coarse.heights.shape == (16, 10)

    def mean(low, high, power):
        return (high ** (power + 1) - low ** (power + 1)) / (power + 1) / (high - low)

    x, y = 2.5 * np.arange(16)[:, None], 4.0 * np.arange(10)[None, :]
    x1, x3 = mean(x, x + 2.5, 1), mean(x, x + 2.5, 3)
    y1, y2 = mean(y, y + 4.0, 1), mean(y, y + 4.0, 2)
    expected = 1 + x1 - 0.5 * y1 + 0.1 * x1 * y2 - 0.02 * x3
    assert coarse.heights == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_spacings_that_differ_by_rounding_keep_the_nodes():
    given = shaped((9, 9), (1.0005, 0.9996), cubic)
    same = resampled(given, (1.0, 1.0))
    assert same.heights is given.heights
    assert same.spacing == (1.0, 1.0)
    assert same.steps == ()
    assert not is_same(1.0, 1.002)


REFUSED: list[tuple[dict[str, Any], str]] = [
    *(({"mask": text}, "--mask") for text in ("3:-5", "nan:1", "9" * 400)),
    *(({"filter": text}, "--filter") for text in (":", "80:2")),
    ({"despike": float("nan")}, "--despike"),
    ({"form": 21}, "--form"),
    ({"downsample": 1}, "--downsample"),
    ({"level": "up"}, "--level"),
    ({"level": "plane", "form": 3}, "--level plane and --form 3"),
]


@pytest.mark.parametrize(("settings", "word"), REFUSED)
def test_settings_out_of_their_ranges_are_refused(settings, word):
    with pytest.raises(InputError) as refusal:
        prepare(topography(X), Reading(**settings))
    assert str(refusal.value).startswith(word)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 300


def test_commands_and_scenes_have_every_key(capsys):
    """Each key is declared once; what is not made of it is forgotten."""
    assert {each.name for each in fields(Reading)} == {*KEYS}
    assert list(keys("preparation")) == list(TAKEN)
    assert cli.main(["describe", "--help"]) == 0
    described = capsys.readouterr().out
    scanned = {"reading": ReadingTable, "preparation": PreparationTable}
    for table, model in scanned.items():
        assert list(model.model_fields) == list(keys(table))
        for name, key in keys(table).items():
            assert as_option(name) in described
            assert model.model_fields[name].description == key.allowed
