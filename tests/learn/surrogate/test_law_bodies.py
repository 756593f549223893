"""Predicted laws of a layer: closed forms between their columns, and what is refused."""

import contextlib
from pathlib import Path

import numpy as np
import pytest
from comparisons import table
from databases import database_of

from learn import cli

SCENE = """
samples = 60
[surface]
nodes = 17
[contact]
boundary = "mirror"
[contact.layer]
thickness = {thickness}
modulus = 5.0
poisson = 0.4
base = "rigid"
[delta]
pieces = [{{ share = 1.0, range = [0.5, 6.0] }}]
"""
COMPLIANCE = 100.0 * 1.4 * 0.2 / (0.6 * 5.0)  # of the layer under a uniform pressure
LAW = ["law", "layer.surrogate", "layer.toml", "--surfaces", "2", "--delta", "1:5:4"]


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A folder with scenes of two layers, and a surrogate of the first."""
    folder = tmp_path_factory.mktemp("layered")
    database = database_of(folder, SCENE.format(thickness="100.0"), "layer")
    (folder / "layer.toml").write_text(SCENE.format(thickness="100.0"))
    (folder / "other.toml").write_text(SCENE.format(thickness="50.0"))
    words = ["fit", database, "--target", "area,force", "--model", "kernel-ridge"]
    words += ["-o", folder / "layer.surrogate"]
    with contextlib.chdir(folder):
        assert cli.main([str(word) for word in words]) == 0
    return folder


@pytest.fixture
def columns(trained, monkeypatch, tmp_path):
    """Predict a law, and return the columns of its table over Delta as numbers."""
    monkeypatch.chdir(trained)

    def predicted(*options):
        path = tmp_path / "law.csv"
        assert cli.main([*LAW, *options, "--csv", str(path)]) == 0
        rows = [row for row in table(path) if row["against"] == "delta_um"]
        return {
            name: np.array([float(row[name]) for row in rows])
            for name in ("delta_um", "closure_um", "pressure_MPa", "mean_gap_um")
        }

    return predicted


def test_predicted_closures_are_without_the_compression_of_a_meshed_layer(columns):
    law = columns()
    assert law["pressure_MPa"][-1] > 0
    closures = law["delta_um"] - COMPLIANCE * law["pressure_MPa"]
    np.testing.assert_allclose(law["closure_um"], closures, rtol=1e-9, atol=1e-12)


def test_predicted_closures_may_have_the_compression_of_the_layer(columns):
    law = columns("--layer-in", "law")
    np.testing.assert_allclose(law["closure_um"], law["delta_um"], rtol=1e-9)


def test_predicted_mean_gaps_fall_by_the_closure(columns):
    """The mean of the surface of a layer sinks by the compression alone."""
    law = columns()
    gaps = law["mean_gap_um"] + law["closure_um"]
    np.testing.assert_allclose(gaps, law["mean_gap_um"][0], rtol=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--e-star", "3"], "trained on layers of 100 um of 5 MPa (Poisson's ratio 0.4)"),
        (["--conductivity", "50"], "--conductivity: leave it out with a layer"),
        (["other.toml"], "a scene has a layer that not all inputs have"),
        (
            ["--layer-thickness", "9", "--layer-young", "5", "--young", "9"],
            "Poisson's ratio 0 on a base of 0: the surrogate was trained on layers with",
        ),
    ],
)
def test_laws_of_other_layers_are_not_predicted(
    trained, monkeypatch, capsys, options, message
):
    monkeypatch.chdir(trained)
    assert cli.main([*LAW, *options]) == 2
    assert message in capsys.readouterr().err


def test_surrogates_of_half_spaces_have_no_law_of_a_layer(work, capsys):
    Path("layer.toml").write_text(
        SCENE.format(thickness="100.0").replace("mirror", "free")
    )
    words = ["law", "hybrid.surrogate", "layer.toml", "--surfaces", "2", "--delta", "5,9"]
    assert cli.main(words) == 2
    assert "was trained on half-spaces: leave out the layer" in capsys.readouterr().err
