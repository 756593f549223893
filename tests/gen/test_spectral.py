"""Surfaces from a power spectrum, against the spectrum asked for and against SurfaceTopography."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gen.generation.plan import parameters
from gen.generation.sample import surface_numbered, surface_of
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.spectral import SelfAffineSpectrum, generate_spectral

SPECTRUM = SelfAffineSpectrum(0.7, roll_off=40.0, cut_off=4.0)


def random(seed=1):
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))


GRIDS = [
    ((128, 128), (200.0, 200.0)),
    ((129, 129), (200.0, 200.0)),
    ((120, 97), (150.0, 190.0)),
    ((31, 200), (60.0, 90.0)),
]


@pytest.mark.parametrize("stretch", [1.0, 3.0, 0.8])
@pytest.mark.parametrize(("shape", "sides"), GRIDS)
def test_every_component_has_its_share(shape, sides, stretch):
    """On oblong grids and cells, odd and even, stretched or not; to 1e-10 of the largest."""
    spectrum = SelfAffineSpectrum(0.7, 40.0, 5.0, stretch)
    heights = generate_spectral(shape, sides, spectrum, random(), rms_height=0.5)
    qx, qy = (
        2 * np.pi * np.fft.fftfreq(nodes, length / nodes)
        for nodes, length in zip(shape, sides, strict=True)
    )
    asked = spectrum.density(qx[:, None], qy[None, :])
    asked[0, 0] = 0.0
    asked *= 0.25 / asked.sum()
    assert heights.shape == shape
    squares = np.abs(np.fft.fft2(heights) / heights.size) ** 2
    assert squares == pytest.approx(asked, abs=1e-10 * asked.max())


def test_one_surface_on_all_grids_that_are_fine_enough():
    """To rounding on the nodes that grids share."""
    fine = generate_spectral((192, 300), (64.0, 50.0), SPECTRUM, random(), rms_height=0.5)
    coarse = generate_spectral((64, 30), (64.0, 50.0), SPECTRUM, random(), rms_height=0.5)
    assert fine[::3, ::10] == pytest.approx(coarse, abs=1e-13)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"hurst": -0.1}, "hurst -0.1: give"),
        (
            {"roll_off": 3.0},
            "roll-off 3.0: give a wavelength of at least the cut-off, 4 um",
        ),
    ],
)
def test_spectra_that_make_no_sense_are_refused(wrong, message):
    settings = {"hurst": 0.5, "roll_off": 40.0, "cut_off": 4.0, "stretch": 1.0}
    with pytest.raises(InputError, match=f"^{message}"):
        SelfAffineSpectrum(**settings | wrong)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"shape": (1, 64)}, "nodes 1 x 64: give at least 2"),
        ({"side": 200.0}, "cut-off 4: give at least 6.25 um"),
        ({"side": 3.0}, "no wave between the cut-off and the sides"),
        ({"rms_height": None, "rms_slope": np.inf}, "rms slope inf: give 0 or more"),
    ],
)
def test_surfaces_that_cannot_be_are_refused(wrong, message):
    settings = {"shape": (64, 64), "side": 100.0, "rms_height": 1.0} | wrong
    shape, side = settings.pop("shape"), settings.pop("side")
    with pytest.raises(InputError, match=f"^{message}"):
        generate_spectral(shape, side, SPECTRUM, random(), **settings)


COMMON = {"nodes": [64, 48], "side": [200.0, 180.0], "hurst": 0.7, "roll_off": 60.0}
COMMON |= {"cut_off": 12.0, "rms_height": 0.5}


def scene(boundary="periodic", **keys):
    """A scene on 64 x 48 nodes, oblong cells, with some other keys."""
    lines = "".join(f"{name} = {value}\n" for name, value in {**COMMON, **keys}.items())
    surface = f'[surface]\ngenerator = "spectral"\n{lines}'
    return Scene.parse(
        f'samples = 400\n{surface}[contact]\nboundary = "{boundary}"', "test"
    )


@pytest.mark.parametrize(
    ("keys", "fault"),
    [
        (
            {"cut_off": 7.4},
            "cut_off is from 7.4 um on; this grid holds waves of 7.5 um and more",
        ),
        ({"cut_off": 55.0, "side": [40.0, 54.0]}, "the longest wave of the period 54 um"),
        ({"nodes": [4000, 4], "period": 4.5}, "its period has 18000 x 18 nodes"),
        (
            {"cut_off": 60.0, "nodes": 2, "side": 30.0},
            "the longest wave of the period 0 um",
        ),
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
        "period": draw(st.sampled_from([1.0, 1.37])),
        "hurst": f"{{ choice = {[0.0, 1.0]} }}",
        "cut_off": f"{{ choice = {cut_off} }}",
        "stretch": f"{{ choice = {stretch} }}",
    }
    try:
        of = scene(**keys)
    except InputError:
        return
    plan = parameters(of, 0, 12)
    for row in range(12):
        heights = surface_of(of, plan, row)
        assert heights.shape == of.shape
        assert np.isfinite(heights).all()


def test_surfaces_beyond_double_precision_are_refused_in_words():
    with pytest.raises(InputError, match="surface 3 cannot be made in double precision"):
        surface_numbered(scene(rms_height=1e300), 3)
