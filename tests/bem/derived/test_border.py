"""The area in the continuum, against circles, waves and rough surfaces whose area is known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bem
from bem.derived import border
from bem.influence import influence_coefficients
from tests.bem.waves import random_waves


def circle(radius, random, kernel="uniform-pressure", n=65):
    """Return the relative error of Hertz's area, its centre anywhere in a cell."""
    x, y = (np.arange(n) - n // 2 - random.uniform(-0.5, 0.5) for _ in range(2))
    force = 4 / 3 * radius**3 / 1e4
    contact = bem.solve(
        -(x[:, np.newaxis] ** 2 + y**2) / 2e4,
        n - 1.0,
        force=force,
        spacing=1.0,
        kernel=kernel,
    )
    return contact.continuum_area_percent / 100 * n**2 / (np.pi * radius**2) - 1


@pytest.mark.parametrize(
    ("radius", "mean", "rms"),
    [
        (1, 0.03, 0.08),
        (2, 0.03, 0.08),
        (3, 0.007, 0.012),
        (12, 0.002, 0.003),
        (24, 0.001, 0.0015),
    ],
)
def test_hertz_circle(radius, mean, rms):
    """From spots of a few nodes on."""
    random = np.random.default_rng(radius)
    errors = np.array([circle(radius, random) for _ in range(30 if radius < 3 else 16)])
    assert abs(errors.mean()) < mean
    assert np.sqrt(np.mean(errors**2)) < rms


@pytest.mark.parametrize(
    "waves", [(8, 0), (8, 1), (7, 2), (6, 2), (8, 4), (8, 6), (6, 6)]
)
def test_westergaard_waves_at_seven_angles(waves):
    """Some 15 nodes a wave: the mean over phases is right to 0.6 %, where a count is 5 % off."""
    n, errors = 128, []
    steepness = 0.01 * np.pi * np.hypot(*waves)
    for share in (0.1, 0.3, 0.6):
        for phase in (np.arange(6) + 0.37) / 6:
            x = (np.arange(n) + phase) / n
            across = waves[0] * x[:, np.newaxis] + waves[1] * np.arange(n) / n
            heights = 0.01 * np.cos(2 * np.pi * across)
            contact = bem.solve(
                heights, 1.0, pressure=share * steepness, boundary="periodic"
            )
            truth = 200 / np.pi * np.arcsin(np.sqrt(share))
            errors.append(contact.continuum_area_percent / truth - 1)
    assert abs(np.mean(errors)) < 0.006
    assert np.sqrt(np.mean(np.square(errors))) < 0.02


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("hardness", "bound"), [(None, 0.005), (0.05, 0.01), (0.02, 0.015)]
)
def test_rough_surfaces_with_eight_nodes_a_wave(hardness, bound):
    """On surfaces that the weights have not seen, against four times as many nodes."""
    errors, counts = [], []
    for seed in (70, 71):
        surface = random_waves(2, 16, 0.8, seed)
        for pressure in (0.001, 0.005, 0.015):
            coarse, fine = (
                bem.solve(
                    surface(n),
                    1.0,
                    pressure=pressure,
                    boundary="periodic",
                    hardness=hardness,
                )
                for n in (128, 512)
            )
            truth = fine.continuum_area_percent
            errors.append(coarse.continuum_area_percent / truth - 1)
            counts.append(coarse.area_percent / truth - 1)
    assert np.sqrt(np.mean(np.square(errors))) < bound
    assert np.mean(counts) > 0.015


@pytest.mark.parametrize("hardness", [1e-3, 1e-2, 0.03, 0.1, 1.0])
@pytest.mark.parametrize("load", [0.02, 0.3, 0.9])
def test_hard_and_soft_bodies_from_light_contact_to_nearly_full(hardness, load):
    """With 8 nodes a wave; contacts of soft bodies are where the surface cuts a plane."""
    surface, pressure = random_waves(1, 8, 0.7, 3), load * min(hardness, 0.2)
    coarse, fine = (
        bem.solve(
            surface(n), 1.0, pressure=pressure, boundary="periodic", hardness=hardness
        )
        for n in (64, 256)
    )
    area = coarse.continuum_area_percent
    assert area >= 100 * pressure / hardness * (1 - 1e-9)
    assert (
        abs(area - fine.continuum_area_percent) <= coarse.grid_error().area_percent + 1e-9
    )


@pytest.mark.parametrize("aspect", [2, 5, 20])
def test_oblong_cells(aspect):
    surface = random_waves(2, 8, 0.8, 7)
    for pressure in (0.005, 0.03):
        coarse, fine = (
            bem.solve(heights, (1.0, 1.0), pressure=pressure, boundary="periodic")
            for heights in (surface(64 * aspect)[:, ::aspect], surface(384))
        )
        assert coarse.continuum_area_percent == pytest.approx(
            fine.continuum_area_percent, 0.01
        )


def test_the_layer_below_concentrated_forces():
    tables = [
        influence_coefficients((400, 400), kernel)
        for kernel in ("concentrated-force", "uniform-pressure")
    ]
    weights = np.where(np.arange(400) == 0, 1, 2)
    assert weights @ (tables[0] - tables[1]) @ weights == pytest.approx(
        border.LAYER, abs=2e-3
    )


@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.integers(1, 9), st.integers(1, 9)),
    st.sampled_from(["free", "periodic", "mirror"]),
    st.sampled_from([None, 0.3, 1.0]),
    st.floats(0.01, 3),
)
@settings(max_examples=150, deadline=None)
def test_any_contact_has_an_area_between_none_and_its_patch(
    seed, shape, boundary, hardness, load
):
    """From a single node to full contact, on grids of a few nodes; turned, it is the same."""
    heights = np.random.default_rng(seed).normal(size=shape)
    force = load * (0.02 if hardness is None else min(hardness, 1.0) / 4) * heights.size
    problem = {
        "force": force,
        "spacing": (1.0, 2.0),
        "boundary": boundary,
        "hardness": hardness,
    }
    contact = bem.solve(heights, (1.0, 1.0), **problem)
    area = contact.continuum_area_percent
    assert 0 <= area <= 100
    if contact.area_percent == 100:
        assert area == 100
    turned = bem.solve(heights.T, (1.0, 1.0), **{**problem, "spacing": (2.0, 1.0)})
    if turned.contact_nodes == contact.contact_nodes:
        assert turned.continuum_area_percent == pytest.approx(area, abs=1e-4)
