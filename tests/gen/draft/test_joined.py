"""Surfaces with the joined spectrum of scans of one surface at different magnifications."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from joined_scans import HEIGHTS, save_scans, scans

from gen import cli
from gen.draft.joined import MOST_NODES, join_in_bands, judged_scan, surface_at_nodes
from gen.draft.populations import FittedMap, fit_joined
from gen.maps.joining import join
from gen.maps.read import Topography
from gen.maps.texture import radial_waves
from gen.population import Population, generate_like
from gen.scene import Scene
from gen.statistics import rms_slope


@pytest.fixture(scope="module")
def joined():
    return join(scans())


@pytest.fixture(scope="module")
def population(joined):
    maps = [FittedMap(scan.topography, "0" * 64) for scan in joined.scans]
    return fit_joined(maps, joined)


@pytest.fixture(scope="module")
def made(population):
    """A surface of the population, of one period."""
    random = np.random.default_rng(1)
    return generate_like(population, population.nodes, population.nodes, random)


def test_surfaces_have_the_roughness_of_the_surface_that_was_scanned(made):
    """The rms height comes from long waves that the fine scan lacks, the rms slope from short ones.

    Over six seeds of the surface the ratios are 0.88 to 1.09 and 0.97 to 1.04.
    """
    assert made.std() == pytest.approx(HEIGHTS.std(), rel=0.15)
    slope = rms_slope(HEIGHTS, (1.0, 1.0))
    assert rms_slope(made, (1.0, 1.0)) == pytest.approx(slope, rel=0.06)


def test_surfaces_have_the_joined_spectrum(joined, made):
    """Within a tenth in all bins of more than 30 waves, because amplitudes are not random."""
    sides = (float(len(made)), float(len(made)))
    periodic = Topography("made", made, sides, boundary="periodic")
    ends = np.append(joined.spectrum.edges[:, 0], joined.spectrum.edges[-1, 1])
    waves = radial_waves(periodic, ends)
    expected = np.interp(
        waves.wavenumbers, joined.spectrum.wavenumbers, joined.spectrum.density
    )
    ratios = waves.density / expected
    well_filled = waves.waves > 30
    assert well_filled.sum() > 12
    np.testing.assert_allclose(ratios[well_filled], 1.0, atol=0.1)


def test_the_population_names_all_scans_and_has_the_finest_spacing(population):
    assert [source.name for source in population.maps] == ["coarse", "middle", "fine"]
    assert population.spacing == (1.0, 1.0)
    assert population.nodes == (320, 320)


def test_waves_that_do_not_fit_into_the_period_are_left_out_and_named():
    coarse, _, fine = scans()
    wide = replace(coarse, sides=(16 * 954.0, 16 * 954.0))
    spectrum = join_in_bands(join([wide, fine]))
    assert spectrum.grid.shape == (MOST_NODES, MOST_NODES)
    [remark] = spectrum.remarks
    assert "waves of 1.02e+03 to 5.12e+03 um are left out" in remark


@pytest.mark.parametrize(
    ("spacing", "shape"), [((1.0, 1.0), (40, 30)), ((2.0, 3.0), (20, 10))]
)
def test_a_surface_at_other_nodes_is_that_at_its_nodes(population, spacing, shape):
    fine_shape = tuple(
        int((n - 1) * step) + 2 for n, step in zip(shape, spacing, strict=True)
    )
    surface = generate_like(population, fine_shape, (320, 320), np.random.default_rng(2))
    heights = surface_at_nodes(population, shape, spacing, np.random.default_rng(2))
    expected = surface[:: int(spacing[0]), :: int(spacing[1])][: shape[0], : shape[1]]
    np.testing.assert_allclose(heights, expected, rtol=0, atol=1e-12)


def test_between_nodes_heights_are_interpolated_linearly(population):
    surface = generate_like(population, (6, 3), (320, 320), np.random.default_rng(2))
    heights = surface_at_nodes(population, (9, 2), (0.5, 1.0), np.random.default_rng(2))
    np.testing.assert_allclose(
        heights[1::2], (surface[:4, :2] + surface[1:5, :2]) / 2, atol=1e-12
    )


def test_the_widest_scan_that_can_be_made_judges(joined):
    assert judged_scan(joined).name == "coarse"
    coarse, _, fine = scans()
    wide = replace(coarse, sides=(16 * 954.0, 16 * 954.0))
    assert judged_scan(join([wide, fine])).name == "fine"


@pytest.mark.long
def test_the_command_writes_a_scene_of_the_joined_spectrum(here, capsys):
    files = [word for name in save_scans(here) for word in ("--like", name)]
    line = ("scene", *files, "--join", "--e-star", "2e5", "-o", "joined.toml")
    assert cli.main(line) == 0
    output = capsys.readouterr().out
    assert "fine.txt: waves of 53.33 to 4 um (limit: nodes)" in output
    assert "surfaces at the nodes of coarse.txt over the map, 160 x 160 nodes" in output
    scene = Scene.parse(Path("joined.toml").read_text(), "joined.toml")
    assert scene.surface.generator == "like"
    text = Path("joined.population.json").read_text()
    assert len(Population.parse(text, "joined").maps) == 3
    assert "scale = 1.0" in Path("joined.toml").read_text()


@pytest.mark.usefixtures("here")
def test_a_single_scan_and_a_law_are_not_joined(refused):
    line = ("scene", "--like", "a.txt", "--join", "-o", "a.toml")
    assert "--join: give two or more --like" in refused(cli, *line)
    assert "--join" in refused(cli, *line, "--like", "b.txt", "--generator", "spectral")
    assert "--join" in refused(cli, "scene", "a.txt", "--join", "-o", "a.toml")
