"""What the paper does not say: other readings, other choices, an iteration that stops early."""

import csv
from pathlib import Path

import numpy as np
import pytest

import bem
from bench.__main__ import main
from bench.unstated import choices, definitions, fixed_point, measurement, report
from bench.unstated.choices import VARIANTS
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.runtime.errors import InputError
from gen.scene import Scene, load
from gen.statistics import describe

PAPER, MIRCO = load("paper"), load("paper-mirco")


def surfaces(scene: Scene, count: int) -> list[np.ndarray]:
    plan = parameters(scene, 0, count)
    return [surface_of(scene, plan, row) for row in range(count)]


def test_our_readings_are_those_of_the_database() -> None:
    (heights,) = surfaces(PAPER, 1)
    values = describe(heights, 1000.0 / 128).values
    ours = [reading for reading in definitions.READINGS if reading.ours]
    assert {reading.column for reading in ours} == {r.column for r in definitions.READINGS}
    for reading in ours:
        assert reading.value(heights, 1000.0 / 128) == pytest.approx(
            values[reading.column], rel=1e-12
        )


def test_readings_count_what_they_say() -> None:
    heights = np.array([[9.0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 5, 0], [0, 0, 0, 6.0]])
    assert definitions.asperity_mean(heights, 1.0, neighbours=4, border=False) == 5
    assert definitions.asperity_mean(heights, 1.0, neighbours=4, border=True) == 20 / 3
    assert definitions.asperity_mean(heights, 1.0, neighbours=8, border=True) == 7.5
    assert definitions.asperity_density(heights, 1.0, neighbours=8, border=False) == 0
    assert definitions.peak_density(heights, 1.0, border=False) == 2 / 32
    assert definitions.peak_density(heights, 1.0, border=True) == 6 / 32
    assert definitions.peak_mean(heights, 1.0, border=True) == 20 / 3


def test_bandwidths_do_not_depend_on_units() -> None:
    (heights,) = surfaces(PAPER, 1)
    for reading in definitions.READINGS:
        if reading.column == "bandwidth_x":
            value = reading.value(heights, 7.8)
            assert reading.value(1e3 * heights, 0.3) == pytest.approx(value, rel=1e-12)


def test_distance_is_measured_in_widths_of_the_papers_range() -> None:
    low, high = measurement.RANGES["peak_density"]
    ends = np.array([low, high])
    assert measurement.range_distance(ends, "peak_density") == 0
    shifted = ends + (high - low)
    assert measurement.range_distance(shifted, "peak_density") == pytest.approx(100)
    with pytest.raises(InputError, match="not in the paper's Table 1"):
        measurement.range_distance(ends, "iterations")


def test_iteration_nears_the_equilibrium_from_below_and_stops_early() -> None:
    (near, far) = fixed_point.compare(MIRCO, 1, (0.3, 0.8))
    assert near.ended == far.ended == 100
    assert 0 < near.force_low < 1  # a contraction by far less than 1: about its tolerance
    assert far.force_low > 1.5  # slow: many times its tolerance is still missing
    assert far.solves > 2 * near.solves


def test_iteration_does_not_end_beyond_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fixed_point, "STEPS", 5)
    (beyond,) = fixed_point.compare(MIRCO, 1, (1.2,))
    assert beyond.ended == 0
    assert np.isnan(beyond.force_low)


def test_iteration_converges_to_the_solution_in_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fixed_point, "TOLERANCE", 1e-7)
    monkeypatch.setattr(fixed_point, "ENOUGH", 1e-8)
    (heights,) = surfaces(MIRCO, 1)
    early, _ = fixed_point.iterate(MIRCO, heights, 8.0)
    exact = bem.solve(
        heights,
        1000.0,
        8.0,
        spacing=1000.0 / 129,
        kernel="concentrated-force",
        far_field="compliant",
    )
    assert early.force == pytest.approx(exact.force, rel=1e-6)


def test_choices_differ_from_the_preset_one_at_a_time() -> None:
    preset = PAPER.model_dump(exclude={"title", "samples"})
    assert VARIANTS[0].name == choices.OURS
    for variant in VARIANTS:
        scene = Scene.parse("samples = 9\n" + variant.scene, variant.name).model_dump(
            exclude={"title", "samples"}
        )
        different = [
            (key, name)
            for key in scene
            for name in (scene[key] if isinstance(scene[key], dict) else [""])
            if (scene[key][name] if name else scene[key])
            != (preset[key][name] if name else preset[key])
        ]
        expected = {choices.OURS: 0, "mirco": 3}.get(variant.name, 1)
        assert len(different) == expected, variant


def test_report_compares_each_choice_with_the_preset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    few = [v for v in VARIANTS if v.name in {choices.OURS, "concentrated"}]
    monkeypatch.setattr(measurement, "VARIANTS", few)
    monkeypatch.setattr(report, "SURFACES", 3)
    monkeypatch.setattr(report, "LIMITED", 1)
    monkeypatch.setattr(report, "SHARES", (0.3,))
    assert main(["unstated", "-o", str(tmp_path), "--rows", "60"]) == 0
    assert len(capfd.readouterr().out.splitlines()) == 4
    with (tmp_path / "unstated.csv").open(encoding="utf-8", newline="") as file:
        ours, other, uncut = csv.DictReader(file)
    assert float(ours["area_times"]) == float(ours["force_times"]) == 1
    assert float(other["area_times"]) < 0.95
    assert float(other["force_times"]) > 1.02
    assert float(uncut["kept"]) == 100 > float(ours["kept"])
    assert ours["trained"] == other["trained"] == uncut["trained"]
    assert float(ours["table_1"]) == float(other["table_1"])
    assert float(ours["tree_r2"]) < float(ours["r2"])
    shown = report.contents(tmp_path)
    assert (tmp_path / "unstated.png").read_bytes().startswith(b"\x89PNG")
    assert len(shown) == 4
