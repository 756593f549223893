"""The verdict on surfaces that are to be like a map."""

import numpy as np
import pytest

from gen import cli
from gen.draft.judge import (
    Judgement,
    Ratio,
    compare_parts,
    judge_surfaces,
    print_judgement,
)
from gen.draft.press import SHARES
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
    return judge_surfaces(heights, (1.0, 1.0), make, BODIES)


def test_a_surface_of_the_population_is_of_its_kind():
    heights = make((64, 64), np.random.default_rng(77))
    judgement = judged(heights)
    assert judgement.verdict == "of its kind"
    assert judgement.sentence.startswith("of its kind")
    assert compare_parts(heights, (1.0, 1.0), make, nodes=32).is_rare
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
        (ratio(1.4, 0.01), ratio(1.0, 0.01), "not of its kind"),
        (ratio(1.0, 0.01), ratio(0.6, 0.02), "not of its kind"),
        (ratio(1.2, 0.01), ratio(1.0, 0.01), "undecided"),  # a single difference
        (ratio(1.2, 0.01), ratio(0.8, 0.01), "not of its kind"),
        (ratio(1.2, 0.2), ratio(1.0, 0.01), "undecided"),  # within the scatter
        (ratio(1.0, 0.4), ratio(1.0, 0.01), "undecided"),  # which is wide
        (ratio(float("nan"), float("nan")), ratio(1.0, 0.01), "not of its kind"),
    ],
)
def test_verdicts_under_one_pressure(area, gap, verdict):
    assert judgement_of((area,), (gap,)).verdict == verdict


def judgement_of(areas, gaps):
    return Judgement(
        surfaces=10,
        nodes=(9, 9),
        pressures=tuple(range(1, 1 + len(areas))),
        answers={"area": areas, "mean gap": gaps, "stiffness": gaps},
        geometry={},
    )


def test_two_small_differences_are_those_of_another_kind():
    off, same = ratio(1.2, 0.01), ratio(1.0, 0.01)
    one = judgement_of((off, same, same), (same, same, same))
    two = judgement_of((off, same, same), (same, same, off))
    assert one.verdict == "undecided"
    assert one.sentence == (
        "undecided: area 1.20 of the map's at 1 MPa, the only difference of area and mean gap"
        " beyond the scatter"
    )
    assert two.verdict == "not of its kind"


def test_a_stiffness_of_another_kind_is_told_beside_the_verdict(capsys):
    same = ratio(1.0, 0.01)
    judgement = judgement_of((same, same), (same, same))
    for stiffnesses, sentence in [
        ((ratio(1.1, 0.01), ratio(1.4, 0.3)), ""),  # small, and within the scatter
        ((ratio(0.6, 0.01), ratio(1.4, 0.01)), "which is 0.60 of the map's at 1 MPa"),
    ]:
        judgement.answers["stiffness"] = stiffnesses
        print_judgement(judgement, "surfaces")
        printed = capsys.readouterr().out
        assert judgement.verdict == "of its kind"
        assert ("does not hold for the stiffness" in printed) == bool(sentence)
        assert sentence in printed


@pytest.mark.parametrize(
    ("area", "clear"),
    [
        (ratio(1.05, 0.02), True),
        (ratio(1.13, 0.02), False),  # the limit is one deviation away
        (ratio(1.2, 0.2), False),
        (ratio(1.32, 0.02), False),  # and so is twice the limit
        (ratio(1.5, 0.02), True),
        (ratio(float("nan"), float("nan")), True),
    ],
)
def test_further_surfaces_are_pressed_if_they_could_change_the_verdict(area, clear):
    assert judgement_of((area,), (ratio(1.0, 0.01),)).is_clear == clear


@pytest.mark.parametrize(("spacing", "nodes"), [(1.0, (80, 65)), (2.0, (160, 130))])
def test_every_second_node_is_pressed_if_it_has_the_slopes(spacing, nodes):
    """Waves of some 20 um have slopes that nodes every 2 um know, and nodes every 4 um do not."""
    surfaces = population(lambda scores: 0.3 * scores, spacing=(spacing, spacing))

    def smooth(shape, random):
        return generate_like(surfaces, shape, (160, 160), random)

    heights = smooth((160, 130), np.random.default_rng(3))
    judgement = judge_surfaces(heights, (spacing, spacing), smooth, BODIES)
    assert judgement.nodes == nodes
    assert judgement.verdict == "of its kind"


def test_a_ratio_without_a_number_stays_so():
    assert np.isnan(ratio(float("nan"), float("nan")).moved(-1.0).mean)


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


# Maps whose kind is known. Ten of each are judged.
NUMBER = 10  # of maps of each kind

FINE = SelfAffineSpectrum(0.8, 24.0, 4.0)
LAY = SelfAffineSpectrum(0.8, 32.0, 10.0, stretch=0.25)
WAVINESS = SelfAffineSpectrum(0.8, 32.0, 20.0)
ROUGHNESS = SelfAffineSpectrum(0.8, 6.0, 4.0)
VALLEYS = SelfAffineSpectrum(0.8, 32.0, 8.0)


def gaussian(seed, nodes):
    return 0.3 * made(FINE, seed, nodes)


def lognormal(seed, nodes):
    return 0.3 * np.exp(0.5 * made(FINE, seed, nodes))


def plateau_honed(seed, nodes):
    """The lower one of two processes: a fine plateau above deep valleys."""
    plateau = 0.1 * made(FINE, seed, nodes)
    return np.minimum(plateau, 0.5 + 0.6 * made(VALLEYS, 100 + seed, nodes))


def directional(seed, nodes):
    """Waves are four times as long along y."""
    return 0.3 * made(LAY, seed, nodes)


def two_scales(seed, nodes):
    waviness = 0.3 * made(WAVINESS, seed, nodes)
    return waviness + 0.03 * made(ROUGHNESS, 100 + seed, nodes)


@pytest.mark.long
@pytest.mark.parametrize(
    ("bodies", "nodes"),
    [(BODIES, 128), (Bodies(231e3), 192)],
    ids=["yielding", "elastic"],
)
@pytest.mark.parametrize(
    "kind", [gaussian, lognormal, plateau_honed, directional, two_scales]
)
def test_surfaces_are_of_the_kind_of_their_map(kind, bodies, nodes):
    verdicts = []
    for seed in range(NUMBER):
        heights = kind(seed, nodes)
        heights -= heights.mean()
        fitted = fitted_to(heights)

        def make(shape, random, population=fitted):
            return generate_like(population, shape, (nodes, nodes), random)

        judgement = judge_surfaces(heights, (1.0, 1.0), make, bodies)
        verdicts.append(judgement.verdict)
    assert verdicts.count("of its kind") >= NUMBER - 1, verdicts
    assert "not of its kind" not in verdicts
