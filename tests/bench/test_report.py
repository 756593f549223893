"""Every part is made by a command that there is."""

from pathlib import Path
from typing import Any

import typer
from page_parts import inputs

from bench import commands, files, page, report
from bench.commands import app as bench
from bench.report import PARTS
from learn.cli import app as learn
from tests.faults.__main__ import app as faults


def test_names_of_parts_are_those_of_their_folders():
    names = [part.name for part in PARTS]
    assert len(names) == len(set(names))
    for each in PARTS:
        assert each.full, each.name
        _assert_a_command(inputs(Path("report")), each)


def _assert_a_command(given, each):
    """Its words are those of a command that there is; options are asked of the command itself."""
    for full in (False, True):
        arguments = inputs(given.output, full=full).arguments(each)
        if not arguments:
            continue
        assert arguments[0] == "-m"
        program: Any = {"bench": bench, "learn": learn, "tests.faults": faults}[
            arguments[1]
        ]
        command: Any = typer.main.get_command(program)
        command = getattr(command, "commands", {}).get(arguments[2], command)
        known = {option for parameter in command.params for option in parameter.opts}
        assert {word for word in arguments[3:] if word.startswith("-")} <= known, (
            arguments
        )


def test_curves_of_a_short_run_have_three_points_or_more():
    """Lists of grids and displacements are what its pictures have on their abscissas."""
    lists = {
        part.name: arguments[place + 1].split(",")
        for part in PARTS
        for arguments in [inputs(Path("report")).arguments(part)]
        for place, word in enumerate(arguments)
        if word in {"--nodes", "--deltas"}
    }
    assert lists
    assert not {name: values for name, values in lists.items() if len(values) == 2}, (
        "`quick` of these reports: give one value or at least three"
    )


def test_every_report_has_a_chapter():
    described = {path.stem for path in (files.HOME / "reports").glob("*.toml")}
    assert described == {part.name for part in PARTS}, (
        "CHAPTERS of bench/report.py lists the files of bench/reports"
    )


FALL = """
def fall(heights, gravity):
    return [
        {"height_m": h, "body": b, "seconds": (2 * h / gravity) ** 0.5 + d, "verdict": "passed"}
        for b, d in (("a ball", 0.0), ("a feather", 1.0))
        for h in heights
    ]
"""

SAID = """
title = "Falling bodies"
quick = "-m bench fall --heights 1,2 -o {folder}"
full = "-m bench fall -o {folder}"
measure = "falling:fall"
help = "Let bodies fall, and take the time."
options.heights = { default = [1, 2, 4], help = "Heights.", metavar = "M,..." }
options.gravity = { default = 9.81, help = "Acceleration." }

[[contents]]
figure = "fall.png"
data = ["fall.csv"]
legend = 0
panels = [
    { x = "height_m", y = "seconds", label = "{body}", axes = { ylim = [0] } },
]
caption = "Time of the fall over the height."

[[contents]]
table = "fall.csv"
caption = "The same as numbers."
columns = ["body", "height_m", "seconds", "verdict"]
verdict = "verdict"
"""


def test_a_new_report_takes_forty_lines(tmp_path, monkeypatch, capsys):
    """A function that returns rows, and its file: command, tables, picture, page and manual."""
    assert len((FALL + SAID).splitlines()) <= 40
    (tmp_path / "reports").mkdir()
    (tmp_path / "reports" / "fall.toml").write_text(SAID)
    (tmp_path / "falling.py").write_text(FALL)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(files, "HOME", tmp_path)
    monkeypatch.setattr(commands, "app", typer.Typer())
    commands.app.command("other")(lambda: None)
    fall = report.part_of("fall", "Physics")
    commands.add(fall)
    made = tmp_path / "report" / "fall"
    assert commands.main(["fall", "--heights", "1,4", "-o", str(made)]) == 0
    printed = capsys.readouterr().out
    assert "| a feather | 4 | 1.903 | passed |" in printed
    assert (made / "fall.png").read_bytes().startswith(b"\x89PNG")
    assert commands.main(["fall", "--heights", "1;4"]) == 2
    assert "heights '1;4': give numbers with commas" in capsys.readouterr().err
    monkeypatch.setattr(files, "HOME", Path(files.__file__).parent)  # of the template
    text = page.page_of([fall], inputs(tmp_path / "report"))
    assert "Falling bodies" in text
    assert text.count("<img ") == text.count("<table>") == 1
    monkeypatch.setattr(page, "PARTS", (fall,))
    monkeypatch.setattr(page, "PUBLISHED", inputs(tmp_path / "report", full=True))
    told = page.fragment("fall", tmp_path)
    assert ":::{figure} report/fall/fall.png" in told
    assert "| a ball | 1 | 0.4515 | passed |" in told
