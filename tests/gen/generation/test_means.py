"""Means of a scene's rows: their standard errors, and the comparison with `[expect]`."""

import re

import numpy as np
import pytest
from databases import database_of, deterministic_bytes

from gen import cli
from gen.generation.means import (
    ComparedMean,
    PopulationMean,
    clustered_mean,
    toml_of,
)
from gen.scene import ExpectedMean, Scene, load, preset_names

SCENE = "samples = 40\nsamples_per_surface = 2\n[surface]\nnodes = 17\n"


def test_the_error_of_single_rows_is_the_standard_error_of_a_mean():
    values = np.random.default_rng(0).normal(3.0, 2.0, 50)
    mean, error = clustered_mean(values, np.arange(50))
    assert mean == pytest.approx(values.mean())
    assert error == pytest.approx(values.std(ddof=1) / np.sqrt(50))


def test_rows_of_a_surface_that_are_equal_tell_no_more_than_one():
    values = np.random.default_rng(1).exponential(size=30)
    once = clustered_mean(values, np.arange(30))
    thrice = clustered_mean(np.repeat(values, 3), np.repeat(np.arange(30), 3))
    assert thrice == pytest.approx(once)


def test_the_error_is_the_scatter_of_means_over_surfaces_with_unlike_numbers_of_rows():
    """Within 10 %: of 400 draws of 60 surfaces, the scatter is known to 3.5 %."""
    random = np.random.default_rng(2)
    means, errors = [], []
    for _ in range(400):
        sizes = random.integers(1, 6, 60)
        surfaces = np.repeat(np.arange(60), sizes)
        values = random.normal(size=60)[surfaces] + 0.3 * random.normal(size=sizes.sum())
        mean, error = clustered_mean(values, surfaces)
        means.append(mean)
        errors.append(error)
    assert np.mean(errors) == pytest.approx(np.std(means), rel=0.1)


def test_squares_of_large_numbers_do_not_overflow():
    mean, error = clustered_mean(np.array([1e308, 0.5e308]), np.array([0, 1]))
    assert mean == pytest.approx(0.75e308)
    assert error == pytest.approx(0.25e308)


def test_one_surface_is_not_judged():
    mean, error = clustered_mean(np.array([1.0, 2.0]), np.array([7, 7]))
    assert mean == 1.5
    assert np.isnan(error)
    measured = PopulationMean("force", "uN", mean, error, surfaces=1, left_out=0)
    compared = ComparedMean(measured, ExpectedMean(mean=100.0))
    assert compared.is_met
    assert "not judged" in compared.in_words


@pytest.mark.parametrize(
    ("expected", "tolerance", "is_met"),
    [(2.4, 0.0, True), (2.41, 0.0, False), (2.41, 0.02, True), (1.59, 0.0, False)],
)
def test_a_mean_may_differ_by_its_tolerance_and_four_standard_errors(
    expected, tolerance, is_met
):
    measured = PopulationMean("force", "uN", 2.0, 0.1, surfaces=50, left_out=0)
    assert ComparedMean(measured, ExpectedMean(expected, tolerance)).is_met == is_met


def test_a_table_has_two_standard_errors_as_tolerance_rounded_up():
    measured = PopulationMean("force", "uN", 1234.5678, 1.04, surfaces=50, left_out=0)
    assert toml_of([measured])[1] == "force = { mean = 1234.6, tolerance = 2.1 }"


def test_expected_means_change_neither_rows_nor_the_identity_of_a_scene(tmp_path, capsys):
    """A run goes on with a scene that expects something else."""
    plain = database_of(tmp_path, SCENE, "plain")
    first = f"{SCENE}[expect]\narea_percent = 7.0\n"
    database_of(tmp_path, first, "rows", "--rows", "0:40")
    other = f"{SCENE}[expect]\nforce = {{ mean = 1.0, tolerance = 0.1 }}\n"
    rows = database_of(tmp_path, other, "rows")
    assert deterministic_bytes(rows) == deterministic_bytes(plain)
    assert "40 rows done" in capsys.readouterr().out
    assert Scene.parse(first, "a").fingerprint() == Scene.parse(SCENE, "b").fingerprint()


def test_a_scene_with_other_parameters_expects_nothing():
    scene = Scene.parse(f"{SCENE}[expect]\narea_percent = 7.0\n", "a")
    assert scene.with_parameters({}, seed=3).expect == scene.expect
    assert scene.with_parameters({"hurst": 0.7}).expect is None
    assert scene.with_parameters({}, nodes=33).expect is None


@pytest.mark.usefixtures("here")
def test_the_table_that_check_prints_is_met_by_other_rows(tmp_path, capsys):
    rows = database_of(tmp_path, SCENE)
    capsys.readouterr()
    assert cli.main(["check", str(rows), "--expect"]) == 0
    printed = capsys.readouterr().out
    table = printed[printed.index("[expect]") :]
    assert re.fullmatch(
        r"\[expect\]\narea_percent = .*\nforce = .*\n", table, flags=re.DOTALL
    )
    (tmp_path / "other.toml").write_text(f"seed = 1\n{SCENE}{table}")
    assert cli.main(["check", "other.toml", "--surfaces", "16"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2
    assert all("of 16 surfaces" in line and "as expected" in line for line in lines)


def test_a_wrong_mean_ends_the_check_of_a_database_with_1(tmp_path, capsys):
    rows = database_of(tmp_path, f"{SCENE}[expect]\narea_percent = 70.0\n")
    assert cli.main(["check", str(rows), "--recompute", "0"]) == 1
    printed = capsys.readouterr().out
    assert "sound" in printed
    assert "of 20 surfaces" in printed
    assert "expected 70: differs by" in printed


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "area = 7.0",
            "expect.area: rows of this scene have no such number; give one of",
        ),
        ("status = 1.0", "expect.status: rows of this scene have no such number"),
        ("mean_gap = 1.0", "expect.mean_gap: rows of this scene have no such number"),
        (
            "force = { mean = 1.0, sd = 2.0 }",
            "expect.force.sd = 2.0; allowed: a table of",
        ),
        (
            "force = { mean = 1.0, tolerance = -1 }",
            "expect.force.tolerance = -1; allowed",
        ),
        ("force = inf", "expect.force.mean = inf; allowed"),
        ("force = '3'", "expect.force = '3'; allowed"),
        ("", "expect = {}; allowed"),
    ],
)
def test_means_that_cannot_be_compared_are_refused(tmp_path, refused, line, message):
    (tmp_path / "a.toml").write_text(f"{SCENE}[expect]\n{line}\n")
    assert message in refused(cli, "run", "a.toml", "-o", "a.h5")


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "a.toml: the scene has no table [expect]"),
        (["--repair"], "--repair: leave it out with a scene"),
        (["--recompute", "3"], "--recompute: leave it out with a scene"),
    ],
)
def test_what_a_scene_without_rows_lacks_is_said(tmp_path, refused, options, message):
    (tmp_path / "a.toml").write_text(SCENE)
    assert message in refused(cli, "check", "a.toml", *options)


def test_every_shipped_scene_expects_an_area():
    for name in preset_names():
        assert "area_percent" in load(name).expect, name


@pytest.mark.few(1)
@pytest.mark.parametrize("name", sorted(preset_names(), key="quick".__ne__))
def test_a_shipped_scene_has_the_means_that_it_expects(name, capsys):
    assert cli.main(["check", name, "--surfaces", "12"]) == 0
    assert "as expected" in capsys.readouterr().out
