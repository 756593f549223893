"""Areal parameters against closed forms, definitions and another program."""

import math
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO

import numpy as np
import pandas as pd
import pytest

from gen import cli
from gen.maps.areal import PARAMETERS, areal_parameters, autocorrelation
from gen.maps.read import Topography
from gen.maps.texture import LAW_UNITS, radial_spectrum
from tests.maps import rough_map

NAMES = [parameter.name for parameter in PARAMETERS if parameter.name != "Smr"]


def values_of(heights, spacing=(1.0, 1.0), boundary="periodic", depth=None):
    cells = [n - (boundary == "free") for n in heights.shape]
    sides = (cells[0] * spacing[0], cells[1] * spacing[1])
    return areal_parameters(Topography("made", heights, sides, boundary=boundary), depth)


def test_a_sine_has_its_closed_forms():
    wavelength, amplitude, nodes = 64.0, 2.0, 256
    wave = amplitude * np.sin(2 * math.pi * np.arange(nodes) / wavelength)
    areal = values_of(7.0 + np.repeat(wave[:, None], 32, axis=1))
    slope = 2 * math.pi * amplitude / wavelength
    expected = {
        "Sa": 2 * amplitude / math.pi,
        "Sq": amplitude / math.sqrt(2),
        "Sp": amplitude,
        "Sv": amplitude,
        "Sz": 2 * amplitude,
        "Sku": 1.5,
        "Sdq": slope / math.sqrt(2),
        "Sal": wavelength * math.acos(0.2) / (2 * math.pi),
    }
    for name, value in expected.items():
        assert areal.values[name] == pytest.approx(value, rel=2e-3), name
    assert areal.values["Ssk"] == pytest.approx(0.0, abs=1e-12)
    places = (np.arange(100000) + 0.5) / 100000
    mean = np.mean(np.sqrt(1 + (slope * np.cos(2 * math.pi * places)) ** 2))
    assert areal.values["Sdr"] == pytest.approx(100 * (mean - 1), rel=2e-3)
    assert math.isnan(areal.values["Str"])  # never falls along the crests
    assert "along all directions" in areal.reason


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_the_autocorrelation_is_its_definition(boundary):
    heights = np.random.default_rng(5).normal(size=(7, 10))
    heights -= heights.mean()
    correlation = autocorrelation(heights, periodic=boundary == "periodic")
    assert correlation.shape == (4, 11)
    for i, j in ((0, 0), (2, 3), (3, -5), (1, -1)):
        if boundary == "periodic":
            mean = np.mean(heights * np.roll(heights, (-i, -j), axis=(0, 1)))
        else:
            pairs = (
                heights[x, y] * heights[x + i, y + j]
                for x in range(7 - i)
                for y in range(max(-j, 0), min(10 - j, 10))
            )
            mean = sum(pairs) / ((7 - i) * (10 - abs(j)))
        assert correlation[i, j + 5] == pytest.approx(
            mean / np.mean(heights**2), abs=1e-12
        )


OF_SURFALIZE = {
    "normal": (2.62203, 0.95356, 0.93786, 9.13373, 90.63665),
    "exponential": (1.26847, 1.94605, 0.0, 28.66794, 100.0),
}
"""Sk, Spk, Svk, Smr1 and Smr2 that surfalize 0.19.2 gives for the heights below."""


@pytest.mark.parametrize("name", OF_SURFALIZE)
def test_another_program_finds_the_same_core(name):
    """It takes 10,000 points of the curve: its numbers are within 0.2 %, and 1e-3 of 100 %."""
    random = np.random.default_rng(1)
    normal = random.normal(size=(100, 100))
    random.normal(size=(100, 100))
    heights = {"normal": normal, "exponential": random.exponential(size=(100, 100))}[name]
    values = values_of(heights).values
    expected = dict(
        zip(("Sk", "Spk", "Svk", "Smr1", "Smr2"), OF_SURFALIZE[name], strict=True)
    )
    for key, value in expected.items():
        assert values[key] == pytest.approx(value, rel=2e-3, abs=1e-9), key


CURVE = {"Sk", "Spk", "Svk", "Smr1", "Smr2"}
UNDEFINED = {
    "flat": (np.full((20, 30), 3.0), {"Ssk", "Sku", "Sal", "Str"} | CURVE),
    "lost": (
        1e9 + 1e-6 * np.random.default_rng(0).normal(size=(20, 20)),
        {"Ssk", "Sku", "Sdq", "Sdr", "Sal", "Str"} | CURVE,
    ),
    "along x": (np.sin(np.arange(60.0))[:, None] + np.zeros(40), {"Str"}),
    "huge": (1e300 * rough_map(), set()),
    "tiny": (1e-300 * rough_map(), set()),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", UNDEFINED)
def test_what_a_surface_does_not_define_is_nan_with_a_reason(case):
    heights, undefined = UNDEFINED[case]
    areal = values_of(heights, boundary="free")
    assert list(areal.values) == NAMES
    unknown = {name for name, value in areal.values.items() if math.isnan(value)}
    assert unknown == undefined
    assert bool(areal.reason) == bool(undefined)


@dataclass(frozen=True, eq=False)
class Described:
    """What `gen describe` prints and writes of a rough map."""

    lines: list[str]
    table: pd.DataFrame
    spectrum: pd.DataFrame


@pytest.fixture(scope="module")
def described(tmp_path_factory):
    folder = tmp_path_factory.mktemp("described")
    np.save(folder / "rough.npy", rough_map())
    command = ["describe", str(folder / "rough.npy"), "--side", "95", "--depth", "0.5"]
    outputs = ["--csv", str(folder / "row.csv"), "--spectrum", str(folder / "waves.csv")]
    printed = StringIO()
    with redirect_stdout(printed):
        assert cli.main([*command, *outputs]) == 0
    return Described(
        lines=printed.getvalue().splitlines(),
        table=pd.read_csv(folder / "row.csv"),
        spectrum=pd.read_csv(folder / "waves.csv"),
    )


def test_describe_prints_each_parameter_with_its_unit_and_meaning(described):
    expected = values_of(rough_map(), boundary="free", depth=0.5).values
    for name, unit, meaning in PARAMETERS:
        line = next(line for line in described.lines if line.startswith(f"{name} "))
        _, value, printed_unit, *_ = line.split()
        assert printed_unit == unit
        assert meaning in line
        assert float(value) == pytest.approx(expected[name], rel=1e-5)


def test_the_table_has_them_after_the_statistics(described):
    columns = list(described.table.columns)
    law = ["Smr", "Smr_depth", *LAW_UNITS, "law", "nodes_a_wave", "units"]
    assert columns[columns.index("warnings") + 1 :] == [*NAMES, *law]


def test_the_table_has_their_values(described):
    expected = values_of(rough_map(), boundary="free", depth=0.5).values
    row = described.table.iloc[0]
    assert row.Sal == pytest.approx(expected["Sal"])
    assert row.Smr == pytest.approx(expected["Smr"])


def test_the_table_has_a_unit_for_each_number(described):
    units = dict(text.rsplit(" ", 1) for text in described.table.units[0].split("; "))
    size = {"nodes_x", "nodes_y", "side_x_um", "side_y_um"}
    texts = {"prepared", "warnings", "law", "units"}
    assert set(units) == set(described.table.columns) - size - texts
    assert (units["Smr1"], units["height_rms"], units["roll_off"]) == ("%", "um", "um")


def test_the_table_says_why_there_is_no_law(described):
    law = described.table.law[0]
    assert law.startswith("none: the spectrum follows a power law over 0.")


def test_the_spectrum_is_written_with_that_of_the_profiles(described):
    written = described.spectrum
    spectrum = radial_spectrum(Topography("made", rough_map(), (95.0, 95.0)))
    np.testing.assert_allclose(written.density_um4, spectrum.density, rtol=1e-12)
    np.testing.assert_allclose(written.density_x_um3, spectrum.along_x, rtol=1e-12)
    np.testing.assert_allclose(written.density_y_um3, spectrum.along_y, rtol=1e-12)
    products = written.wavelength_um * written.wavenumber_per_um
    np.testing.assert_allclose(products, 2 * math.pi)
