"""The verdict on surfaces that are to be like a map."""

import numpy as np
import pytest

from gen import cli
from gen.draft.judge import SHARES, Judgement, Ratio, judge_surfaces
from gen.draft.parts import Outside
from gen.material import Bodies
from gen.population import generate_like
from gen.scene import load
from gen.spectral import SelfAffineSpectrum, generate_spectral
from tests.gen.draft.test_populations import fitted_to, made
from tests.like_maps import population

BODIES = Bodies(231e3, hardness=2000.0)
GAUSSIAN = population(lambda scores: 0.3 * scores)


def make(shape, random):
    return generate_like(GAUSSIAN, shape, (82, 82), random)


def judged(heights):
    return judge_surfaces(heights, (1.0, 1.0), make, BODIES, nodes=32)


def test_a_surface_of_the_population_is_of_its_kind():
    judgement = judged(make((64, 64), np.random.default_rng(77)))
    assert judgement.verdict == "of its kind"
    assert judgement.sentence.startswith("of its kind")
    assert judgement.outside.is_rare
    assert len(judgement.pressures) == len(SHARES)


def test_a_map_with_a_step_is_not():
    """Half of it lies deeper than the roughness, so that its mean gap is half of the step."""
    heights = make((64, 64), np.random.default_rng(77))
    heights[:32] -= 3.0
    judgement = judged(heights)
    assert judgement.verdict == "not of its kind"
    assert "mean gap" in judgement.sentence
    assert all(ratio.mean < 0.5 for ratio in judgement.answers["mean gap"])


def ratio(mean, scatter):
    return Ratio(mean=mean, scatter=scatter)


@pytest.mark.parametrize(
    ("area", "gap", "verdict"),
    [
        (ratio(1.1, 0.01), ratio(0.9, 0.05), "of its kind"),
        (ratio(1.2, 0.01), ratio(1.0, 0.01), "not of its kind"),
        (ratio(1.0, 0.01), ratio(0.8, 0.02), "not of its kind"),
        (ratio(1.2, 0.2), ratio(1.0, 0.01), "undecided"),  # within the scatter
        (ratio(1.0, 0.4), ratio(1.0, 0.01), "undecided"),  # which is wide
        (ratio(float("nan"), float("nan")), ratio(1.0, 0.01), "not of its kind"),
    ],
)
def test_verdicts(area, gap, verdict):
    judgement = Judgement(
        nodes=(9, 9),
        pressures=(1.0,),
        answers={"area": (area,), "mean gap": (gap,)},
        geometry={},
        outside=Outside(number=0, parts=9, names=()),
    )
    assert judgement.verdict == verdict


def test_a_ratio_is_that_of_the_mean_with_the_relative_scatter():
    """Of 1, 2 and 3 over 4: 1/2, and a standard deviation of 1 over a mean of 2."""
    assert Ratio.of([1.0, 2.0, 3.0], 4.0) == ratio(0.5, 0.5)
    assert Ratio.of([1.0, 2.0, 3.0], 4.0).text == "0.50 +- 0.25"


def law_map():
    spectrum = SelfAffineSpectrum(hurst=0.8, roll_off=30.0, cut_off=1.8)
    random = np.random.default_rng(0)
    surface = generate_spectral((400, 400), 200.0, spectrum, random, rms_slope=0.1)
    return surface[:300, :300]


def stepped():
    heights = make((96, 96), np.random.default_rng(5))
    heights[:48] -= 3.0
    heights[10:20, 60:80] += 1.0
    return heights


@pytest.mark.parametrize(
    ("heights", "side", "generator", "words"),
    [
        pytest.param(
            law_map(), "149.5", "spectral", "verdict: of its kind", marks=pytest.mark.long
        ),
        (stepped(), "95", "scans", "not of its kind"),
    ],
    ids=["law", "steps"],
)
def test_the_contact_chooses_the_generator(here, capsys, heights, side, generator, words):
    np.save(here / "map.npy", heights)
    options = ["--side", side, "-o", "mine.toml"]
    assert cli.main(["scene", "--like", "map.npy", *options]) == 0
    assert words in capsys.readouterr().out
    assert load("mine.toml").surface.generator == generator


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("map.npy --generator like", "needs --like"),
        ("--like map.npy --generator noise", "give spectral"),
        ("--like map.npy --like map.npy --generator spectral", "give one --like"),
    ],
)
def test_wrong_generators_are_one_line(here, refused, arguments, words):
    np.save(here / "map.npy", stepped())
    line = refused(cli, "scene", *arguments.split(), "--side", "95", "-o", "mine.toml")
    assert words in line


# Maps whose kind is known. Ten of each are judged, between bodies that yield.
NODES = 128
NUMBER = 10  # of maps of each kind

FINE = SelfAffineSpectrum(0.8, 24.0, 4.0)
LAY = SelfAffineSpectrum(0.8, 32.0, 10.0, stretch=0.25)
WAVINESS = SelfAffineSpectrum(0.8, 32.0, 20.0)
ROUGHNESS = SelfAffineSpectrum(0.8, 6.0, 4.0)
VALLEYS = SelfAffineSpectrum(0.8, 32.0, 8.0)


def gaussian(seed):
    return 0.3 * made(FINE, seed, NODES)


def lognormal(seed):
    return 0.3 * np.exp(0.5 * made(FINE, seed, NODES))


def plateau_honed(seed):
    """The lower one of two processes: a fine plateau above deep valleys."""
    return np.minimum(
        0.1 * made(FINE, seed, NODES), 0.5 + 0.6 * made(VALLEYS, 100 + seed, NODES)
    )


def directional(seed):
    """Waves are four times as long along y."""
    return 0.3 * made(LAY, seed, NODES)


def two_scales(seed):
    return 0.3 * made(WAVINESS, seed, NODES) + 0.03 * made(ROUGHNESS, 100 + seed, NODES)


@pytest.mark.long
@pytest.mark.parametrize(
    "kind", [gaussian, lognormal, plateau_honed, directional, two_scales]
)
def test_surfaces_are_of_the_kind_of_their_map(kind):
    verdicts = []
    for seed in range(NUMBER):
        heights = kind(seed)
        heights -= heights.mean()
        fitted = fitted_to(heights)

        def make(shape, random, population=fitted):
            return generate_like(population, shape, (NODES, NODES), random)

        judgement = judge_surfaces(heights, (1.0, 1.0), make, BODIES, NODES // 2)
        verdicts.append(judgement.verdict)
    assert verdicts.count("of its kind") >= NUMBER - 1, verdicts
    assert "not of its kind" not in verdicts
