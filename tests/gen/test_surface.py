"""Surfaces: nested, self-affine by construction, or refused."""

import math
import re
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from launch import python

from gen.runtime.errors import InputError
from gen.surface import GENERATORS, generate

names = pytest.mark.parametrize("generator", sorted(GENERATORS))


def surface(generator, nodes, seed=5, hurst=0.7, sigma0=12.0):
    return generate(generator, nodes, hurst, sigma0, np.random.default_rng(seed))


def plain(generator, nodes, hurst, sigma0, random):
    """The definitions node by node: centres, then edges along x, then edges along y."""
    z = np.zeros((nodes, nodes))

    def displace(i, j, neighbours, deviation):
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
    assert surface(generator, nodes, hurst=hurst) == pytest.approx(
        expected, rel=1e-12, abs=1e-12
    )


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


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"hurst": -0.1}, "hurst -0.1: give a Hurst exponent from 0 to 1$"),
        ({"sigma0": math.inf}, "sigma0 inf: give a standard deviation of 0 um or more$"),
        ({"generator": "brown"}, "generator 'brown': .*diamond-square, midpoint$"),
    ],
)
def test_surfaces_that_cannot_be_are_refused(wrong, message):
    with pytest.raises(InputError, match=f"^{message}"):
        surface(**{"generator": "midpoint", "nodes": 5, **wrong})


ROOT = Path(__file__).resolve().parents[2]
RIDGES = """samples = 4
[surface]
generator = "ridges"
nodes = [24, 20]
side = 100.0
amplitude = [1.0, 2.0]
wavelength = 25.0
[delta]
pieces = [{ share = 1.0, range = [0.5, 1.0] }]
"""


class Copy:
    """A copy of the program with the generator of the manual, and a database of its surfaces."""

    def __init__(self, folder):
        self.folder = folder
        manual = (ROOT / "docs/how-to/scenes.md").read_text(encoding="utf-8")
        pattern = r"```python\n# gen/generators/ridges.py\n(.*?)```"
        (code,) = re.findall(pattern, manual, re.DOTALL)
        without_caches = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / "gen", folder / "gen", ignore=without_caches)
        generators = folder / "gen/generators"
        (generators / "ridges.py").write_text(code)
        text = (generators / "__init__.py").read_text()
        for line, added in (
            ("    PythonSurface,\n", "    RidgedSurface,\n"),
            (
                "from gen.generators.scans import ScanSurface\n",
                "from gen.generators.ridges import RidgedSurface\n",
            ),
        ):
            assert line in text
            text = text.replace(line, line + added)
        (generators / "__init__.py").write_text(text)
        (folder / "ridges.toml").write_text(RIDGES)

    def run(self, *words):
        """Run a command of the copy."""
        return python(
            "-m", "gen", *words, folder=self.folder, PYTHONPATH=str(self.folder)
        )


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    copy = Copy(tmp_path_factory.mktemp("copy"))
    done = copy.run("run", "ridges.toml", "-o", "ridges.h5")
    assert done.returncode == 0, done.stderr
    return copy


def test_a_new_generator_s_parameters_are_drawn_into_columns(copy):
    with h5py.File(copy.folder / "ridges.h5") as file:
        amplitudes, meaning = file["amplitude"][:], file["wavelength"].attrs["long_name"]
    assert all(1 <= amplitude <= 2 for amplitude in amplitudes)
    assert len(set(amplitudes)) == 4
    assert meaning == b"distance of the ridges"


def test_a_new_generator_s_parameters_are_in_the_manual_s_table(copy):
    meaning = "amplitude of the ridges (with the generator `ridges`)"
    assert f"| `amplitude` | um | {meaning} |" in copy.run("columns").stdout


def test_rows_of_a_new_generator_are_computed_again_alike(copy):
    done = copy.run("check", "ridges.h5", "--recompute", "4")
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_generator_that_is_misspelt_is_refused_beside_the_new_one(copy):
    (copy.folder / "ridge.toml").write_text(RIDGES.replace("ridges", "ridge"))
    done = copy.run("run", "ridge.toml", "-o", "none.h5")
    assert done.returncode == 2
    assert "'ridges'" in done.stderr
