"""Surfaces: nested, self-affine by construction, or refused."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gen.runtime.errors import InputError
from gen.surface import GENERATORS, generate

names = pytest.mark.parametrize("generator", sorted(GENERATORS))


def surface(generator: str, nodes: int, seed: int = 5, hurst: float = 0.7, sigma0: float = 12.0):
    return generate(generator, nodes, hurst, sigma0, np.random.default_rng(seed))


# ---------------------------------------------------------------- generators


def plain(generator: str, nodes: int, hurst: float, sigma0: float, random: np.random.Generator):
    """The definitions node by node: centres, then edges along x, then edges along y."""
    z = np.zeros((nodes, nodes))

    def displace(i: int, j: int, neighbours: list[tuple[int, int]], deviation: float) -> None:
        inside = [z[k, m] for k, m in neighbours if 0 <= k < nodes and 0 <= m < nodes]
        z[i, j] = math.fsum(inside) / len(inside) + deviation * random.standard_normal()

    step, level = nodes - 1, 0
    while step > 1:
        h = step // 2
        at_centres = sigma0 * 2 ** (-hurst * level)
        at_edges = at_centres
        if generator == "diamond-square":
            at_edges *= 2 ** (-hurst / 2)
        for i in range(h, nodes, step):
            for j in range(h, nodes, step):
                corners = [(i - h, j - h), (i - h, j + h), (i + h, j - h), (i + h, j + h)]
                displace(i, j, corners, at_centres)
        for first_i, first_j in ((h, 0), (0, h)):
            for i in range(first_i, nodes, step):
                for j in range(first_j, nodes, step):
                    along_x, along_y = [(i - h, j), (i + h, j)], [(i, j - h), (i, j + h)]
                    if generator == "diamond-square":
                        neighbours = along_x + along_y
                    else:
                        neighbours = along_x if first_i else along_y
                    displace(i, j, neighbours, at_edges)
        step, level = h, level + 1
    return z - z.min()


@names
@pytest.mark.parametrize("nodes", [3, 17])
@pytest.mark.parametrize("hurst", [0.0, 0.65])
def test_follows_its_definition_node_by_node(generator, nodes, hurst):
    expected = plain(generator, nodes, hurst, 12.0, np.random.default_rng(5))
    assert surface(generator, nodes, hurst=hurst) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@names
@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    hurst=st.floats(0.0, 1.0),
    coarse=st.integers(1, 4),
    finer=st.integers(1, 3),
)
def test_a_seed_gives_the_same_coarse_nodes_at_every_resolution(
    generator, seed, hurst, coarse, finer
):
    few = surface(generator, 2**coarse + 1, seed, hurst)
    many = surface(generator, 2 ** (coarse + finer) + 1, seed, hurst)
    shift = many[:: 2**finer, :: 2**finer] - few
    assert shift == pytest.approx(shift[0, 0], abs=1e-12 * many.max())


@names
@pytest.mark.parametrize("nodes", [-3, 2, 128])
def test_nodes_that_are_no_power_of_two_plus_one_are_refused(generator, nodes):
    with pytest.raises(InputError, match=rf"^nodes {nodes}: give 2\^k \+ 1, as 3, 5, 9"):
        surface(generator, nodes)


@pytest.mark.parametrize("hurst", [-0.1, math.nan])
def test_hurst_exponents_that_are_none_are_refused(hurst):
    with pytest.raises(InputError, match=r"^hurst .*: give a Hurst exponent from 0 to 1$"):
        surface("midpoint", 5, hurst=hurst)


@pytest.mark.parametrize("sigma0", [-1.0, math.inf])
def test_standard_deviations_that_are_none_are_refused(sigma0):
    with pytest.raises(InputError, match=r"^sigma0 .*: give a standard deviation of 0 um or more$"):
        surface("midpoint", 5, sigma0=sigma0)


def test_unknown_generator_is_refused_with_those_there_are():
    with pytest.raises(InputError, match=r"^generator 'brown': .*diamond-square, midpoint$"):
        surface("brown", 5)
