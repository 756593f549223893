"""The report compares every choice with the preset."""

import csv
from pathlib import Path

import pytest

from bench.__main__ import main
from bench.page.parts import contents_of
from bench.paper.unstated import effects, report
from bench.paper.unstated.effects import OURS, VARIANTS


def test_report_compares_each_choice_with_the_preset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    few = [v for v in VARIANTS if v.name in {OURS, "concentrated"}]
    monkeypatch.setattr(effects, "VARIANTS", few)
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
    shown = contents_of("paper/unstated", tmp_path)
    assert (tmp_path / "unstated.png").read_bytes().startswith(b"\x89PNG")
    assert len(shown) == 4
