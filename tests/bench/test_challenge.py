"""The contact-mechanics challenge without adhesion, on tiny grids."""

import numpy as np
import pytest

from bench import challenge, commands
from bench.report import part_of
from gen.self_affine import SelfAffineSpectrum
from gen.statistics import rms_slope


@pytest.fixture
def smooth(monkeypatch):
    """A spectrum whose shortest wave needs few nodes."""
    spectrum = SelfAffineSpectrum(hurst=0.8, roll_off=50.0, cut_off=25.0)
    monkeypatch.setattr(challenge, "SPECTRUM", spectrum)


@pytest.mark.usefixtures("smooth")
def test_grids_with_few_nodes_a_wave_agree_on_gap_and_stiffness():
    """Waves of 8 and 16 nodes: to 5 %, and each within its bar."""
    rows = challenge.challenge([64, 32]).tables["challenge"]
    assert [row["nodes"] for row in rows] == [32, 64]
    assert [row["nodes_a_wave"] for row in rows] == [8, 16]
    coarse, fine = rows
    for answer in ("mean_gap_um", "stiffness_per_area"):
        assert coarse[answer] == pytest.approx(fine[answer], rel=0.05)
    assert abs(coarse["continuum_percent"] - fine["continuum_percent"]) < (
        coarse["continuum_bar_percent"] + fine["continuum_bar_percent"]
    )
    assert all(row["convolutions"] > 0 for row in rows)


@pytest.mark.usefixtures("smooth")
def test_the_surface_has_the_slope_of_the_challenge_and_is_one_on_all_grids():
    fine, coarse = challenge.made_surface(256, 3), challenge.made_surface(64, 3)
    spacing = challenge.SIDE / 256
    assert rms_slope(fine, (spacing, spacing)) == pytest.approx(1.0, rel=0.01)
    assert fine[::4, ::4] == pytest.approx(coarse, abs=1e-12)


def test_a_surface_is_made_with_more_than_two_nodes_in_its_shortest_wave():
    assert challenge.nodes_of_made_surface(512) == 2048
    assert challenge.nodes_of_made_surface(4096) == 4096


@pytest.mark.usefixtures("here", "smooth")
def test_a_map_has_the_answers_of_the_surface_that_it_was_written_from(capsys):
    np.save("map.npy", challenge.made_surface(32, 1))
    assert commands.main(["challenge", "--nodes", "16,32", "--surface", "map.npy"]) == 0
    printed = capsys.readouterr().out
    assert "include it, and are no reference" in printed
    (*_, made) = challenge.challenge([32], seed=1).tables["challenge"]
    assert f"{made['continuum_percent']:.4g}" in printed


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--nodes", "24"], "nodes 24: map.npy has 32 a side; give its divisors"),
        (["--nodes", "64"], "nodes 64: map.npy has 32 a side; give its divisors"),
        (["--nodes", "8"], "nodes 8: give 16 to 16,384 nodes a side"),
        (["--nodes", "16,x"], "give numbers with commas between them"),
        (["--nodes", "16", "--unit", "ells"], "ells"),
        (["--nodes", "16", "--surface", "oblong.npy"], "16 x 32 nodes; the map of the"),
        (
            ["--nodes", "16", "--surface", "holes.npy"],
            "holes.npy: nodes without a height: 1",
        ),
        (["--nodes", "16", "--surface", "none.npy"], "none.npy"),
    ],
)
def test_what_is_no_map_of_the_challenge_is_refused(words, message, capsys):
    heights = np.random.default_rng(0).random((32, 32))
    np.save("map.npy", heights)
    np.save("oblong.npy", heights[:16])
    heights[3, 4] = np.nan
    np.save("holes.npy", heights)
    if "--surface" not in words:
        words = [*words, "--surface", "map.npy"]
    assert commands.main(["challenge", *words]) == 2
    assert message in capsys.readouterr().err


def test_the_page_says_that_the_published_answers_include_adhesion():
    captions = [content["caption"] for content in part_of("challenge").contents]
    assert any("include adhesion" in " ".join(caption.split()) for caption in captions)
