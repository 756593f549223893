"""Theories beside contacts without edges: small surfaces, and the files of the report."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bem.analytic import BUSH_GIBSON_THOMAS, PERSSON
from bench import theory
from bench.report import Report
from gen.spectral import SelfAffineSpectrum

NODES = 128


@pytest.fixture(scope="module")
def rows() -> list[dict[str, Any]]:
    return theory.theory(NODES, surfaces=1)


def column(rows: list[dict[str, Any]], name: str) -> np.ndarray:
    """One value for each spectrum and load, (spectra, loads)."""
    return np.array([row[name] for row in rows]).reshape(len(theory.SPECTRA), -1)


def test_areas_lie_between_the_theories(rows: list[dict[str, Any]]) -> None:
    """Of medium loads; on a grid the areas of light loads are a few nodes."""
    pressure, area = column(rows, "pressure"), column(rows, "corrected_percent")
    assert (area < column(rows, "area_percent")).all()
    assert (np.diff(area, axis=1) > 0).all()
    medium = slice(4, 9)
    slopes = (area / 100 / pressure)[:, medium]
    assert (slopes > PERSSON).all()
    assert (slopes < BUSH_GIBSON_THOMAS).all()
    assert area[:, -1] == pytest.approx(column(rows, "persson_percent")[:, -1], rel=0.03)


def test_gaps_and_stiffness_are_those_of_perssons_relation(rows: list[dict[str, Any]]) -> None:
    """To 10 % where a patch holds many waves, which are those of the narrow band."""
    narrow, medium = 0, slice(3, 10)
    for name in ("mean_gap", "stiffness"):
        computed = column(rows, name)[narrow, medium]
        expected = column(rows, f"persson_{name}")[narrow, medium]
        assert computed == pytest.approx(expected, rel=0.1)


def test_stiffness_is_the_slope_of_the_mean_gap(rows: list[dict[str, Any]]) -> None:
    """Between loads half as large again, to 15 %."""
    pressure, gap = column(rows, "pressure"), column(rows, "mean_gap")
    compliance = -np.diff(gap[:, :-3], axis=1) / np.diff(pressure[:, :-3], axis=1)
    stiffness = column(rows, "stiffness")[:, :-3]
    between = np.sqrt(stiffness[:, 1:] * stiffness[:, :-1])
    assert compliance * between == pytest.approx(1, rel=0.15)


def test_broad_bands_have_large_bandwidth_parameters() -> None:
    """Nayak's alpha is 1.5 for one wavelength, and 2 for a flat spectrum from no wavenumber on."""
    flat = SelfAffineSpectrum(0.8, 1e-3, 1e-3)
    assert theory.nayak(theory.persson(flat)) == pytest.approx(2, rel=1e-3)
    bands = [SelfAffineSpectrum(0.8, band * 1e-3, 1e-3) for band in (1, 4, 16)]
    assert (np.diff([theory.nayak(theory.persson(each)) for each in bands]) > 0).all()


def test_perssons_interface_has_the_moments_of_the_surfaces() -> None:
    """The rms slope to rounding; the rms height, of few long waves, to 5 %."""
    spectrum = SelfAffineSpectrum(0.8, 0.25, 0.0625)
    interface = theory.persson(spectrum)
    assert interface.rms_slope() == pytest.approx(theory.RMS_SLOPE, rel=1e-12)
    rms_height = theory.surface(spectrum, NODES, seed=0).std()
    assert interface.rms_height() == pytest.approx(rms_height, rel=0.05)


def test_report_is_a_table_and_two_pictures(rows: list[dict[str, Any]], tmp_path: Path) -> None:
    paths = Report({"theory": rows}).write(tmp_path, "theory")
    assert [path.name for path in paths] == ["theory.csv", "area.png", "gap.png"]
