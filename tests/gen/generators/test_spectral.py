"""Spectral surfaces of scenes: what is refused before a run, rms values, windows, any boundary."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from SurfaceTopography import Topography

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


def test_heights_of_a_whole_period_have_the_rms_asked_for():
    plan, drawn = surfaces(scene(rms="rms_height = [0.2, 3.0]"), 5)
    assert [heights.std() for heights in drawn] == pytest.approx(plan.drawn["rms_height"], 1e-12)
    assert [heights.min() for heights in drawn] == [0.0] * 5


def test_slopes_of_a_whole_period_have_the_rms_asked_for():
    """The rms gradient by the derivative of the trigonometric interpolant, to rounding."""
    of = scene(rms="rms_slope = [0.02, 0.1]", nodes=[63, 49])
    plan, drawn = surfaces(of, 5)
    for row, heights in enumerate(drawn):
        slopes = [
            np.fft.ifft(
                np.fft.fft(heights, axis=axis)
                * (2j * np.pi * np.fft.fftfreq(nodes, spacing)).reshape(shape),
                axis=axis,
            ).real
            for axis, (nodes, spacing, shape) in enumerate(
                zip(heights.shape, of.spacing, ((-1, 1), (1, -1)), strict=True)
            )
        ]
        assert np.sqrt(np.mean(slopes[0] ** 2 + slopes[1] ** 2)) == pytest.approx(
            plan.drawn["rms_slope"][row], rel=1e-10
        )


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


def averaged_spectrum(of, number):
    """Mean square height of all components over some whole periods [um^2]."""
    _, drawn = surfaces(of, number)
    return np.mean([np.abs(np.fft.fft2(heights) / heights.size) ** 2 for heights in drawn], axis=0)


def asked_spectrum(of):
    """Mean square height of all components as the scene describes it: flat, power law, nothing."""
    stretch, hurst = float(of.surface.stretch), float(of.surface.hurst)
    qx, qy = (
        2 * np.pi * np.fft.fftfreq(nodes, spacing)
        for nodes, spacing in zip(of.shape, of.spacing, strict=True)
    )
    wavelengths = 2 * np.pi / np.maximum(np.hypot(stretch * qx[:, None], qy[None, :]), 1e-30)
    density = np.minimum(wavelengths / 60.0, 1.0) ** (2 + 2 * hurst)
    density[(wavelengths < of.surface.cut_off * (1 - 1e-9)) | (wavelengths > 1e20)] = 0.0
    return density * 0.25 / density.sum()


@pytest.mark.parametrize("stretch", [1.0, 2.0])
@pytest.mark.parametrize("hurst", [0.3, 0.9])
def test_200_surfaces_have_the_power_spectrum_asked_for(stretch, hurst):
    """Every component between the cut-offs, anisotropic ones too, within 3 % of the scene's."""
    of = scene(stretch=stretch, hurst=hurst, cut_off=14.0)
    asked = asked_spectrum(of)
    measured = averaged_spectrum(of, 200)
    held = asked > 0
    assert held.sum() > 200
    np.testing.assert_allclose(measured[held], asked[held], rtol=0.03)
    measured[0, 0] = 0.0  # heights are counted from the lowest node
    assert measured[~held].max() < 1e-25


def test_the_estimator_of_surface_topography_finds_the_spectrum():
    """Its isotropic spectrum of 200 surfaces falls as q^(-2 - 2 H), within 3 % of the density."""
    of = scene(nodes=128, side=200.0, cut_off=6.0)
    _, drawn = surfaces(of, 200)
    spectra = []
    for heights in drawn:
        topography = Topography(heights, (200.0, 200.0), periodic=True)
        wavenumbers, density = topography.power_spectrum_from_area(nb_points_per_decade=20)
        spectra.append(np.ma.filled(density, np.nan))
    mean = np.mean(spectra, axis=0)
    inside = np.isfinite(mean) & (wavenumbers > 2 * np.pi / 25.0) & (wavenumbers < 2 * np.pi / 7.0)
    assert inside.sum() >= 8
    slope = np.polyfit(np.log(wavenumbers[inside]), np.log(mean[inside]), 1)[0]
    assert slope == pytest.approx(-2 - 2 * 0.7, rel=0.03)
    expected = asked_spectrum(of)[1, 0] * 200.0**2 * (wavenumbers[inside] * 60 / 2 / np.pi) ** -3.4
    assert mean[inside] == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("m", [1, 3])
def test_rows_of_a_surface_share_it(m):
    text = SCENE.replace("samples = 400", f"samples = 12\nsamples_per_surface = {m}").format(
        nodes=8,
        side=100.0,
        hurst=0.5,
        cut_off=30.0,
        rms="rms_height = [0.5, 1.0]",
        stretch=1.0,
        further="",
        boundary="free",
    )
    _, drawn = surfaces(Scene.parse(text, "test"), 12)
    same = [np.array_equal(drawn[row], drawn[row - row % m]) for row in range(12)]
    assert all(same)
    assert not np.array_equal(drawn[0], drawn[m])


@pytest.mark.parametrize(
    ("keys", "fault"),
    [
        ({"cut_off": 7.4}, "cut_off is from 7.4 um on; this grid holds waves of 7.5 um and more"),
        ({"cut_off": "[7.0, 20.0]"}, "cut_off is from 7 um on"),
        ({"cut_off": 7.5, "stretch": 0.5}, "waves of 12.5 um"),
        ({"cut_off": 7.5, "boundary": "free"}, "waves of 7.65957 um"),
        ({"cut_off": 55.0, "side": [40.0, 54.0]}, "the longest wave of the period 54 um"),
        ({"cut_off": 55.0, "side": [56.0, 54.0], "stretch": 2.0}, "period 54 um"),
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


def test_refused_grids_are_those_that_no_surface_has():
    """What a scene refuses at the limit cannot be made, and what it accepts can."""
    limit = 2 * 200.0 / 64
    of = scene(side=200.0, nodes=64, cut_off=limit)
    assert surfaces(of, 1)[1][0].std() == pytest.approx(0.5)
    with pytest.raises(InputError):
        scene(side=200.0, nodes=64, cut_off=limit * (1 - 1e-9))
