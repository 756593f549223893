"""The command line: every command, wrong input in one line, and texts that programs read."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import strict

from gen import cli as gen_cli
from gen.database import Reader
from learn import cli

PREDICT = ["predict", "hybrid.surrogate", "--side", "1000", "--delta", "5"]


WRONG = [
    (["card", "database.h5"], "is no surrogate"),
    (["predict", "hybrid.surrogate", "table.csv", "--delta", "5"], "need the surface"),
    (
        ["predict", "hybrid.surrogate", "many/s0.npy", "--side", "9"],
        "give some, and --delta",
    ),
    (["predict", "paper.surrogate", "table.csv", "--mean"], "predicts for surfaces"),
    (
        ["predict", "paper.surrogate", "broken.csv", "--delta", "5"],
        "row 1: peak_mean is 'x'",
    ),
    (["predict", "paper.surrogate", "short.csv", "--delta", "5"], "has no column"),
    (
        ["predict", "paper.surrogate", "long.csv", "--delta", "5"],
        "row 1: has more cells than the header",
    ),
    (
        ["predict", "paper.surrogate", "table.csv", "--delta", "5", "--interval", "2"],
        "--interval",
    ),
    (["fit", "database.h5", "-o", "x", "--from", "out"], "is no comparison"),
    ([*PREDICT, "holes.npy"], "--fill closes holes"),
    ([*PREDICT, "bare"], "bare: the folder holds no map"),
    (["fit", "empty.h5", "-o", "x"], "empty.h5 is empty"),
    (["predict", "paper.surrogate", "table.csv"], "give some, and --delta"),
    (
        ["predict", "paper.surrogate", "table.csv", "--delta", "5", "--e-star", "-1"],
        "--e-star",
    ),
    (
        [*PREDICT[:2], "database.h5", "--delta", "5"],
        "database.h5: SurfaceTopography cannot read",
    ),
    (["fit", "unfinished.h5", "-o", "x"], "5 usable rows, 10 at least are needed"),
    (["fit", "database.h5", "-o", "x", "--target", "area,area"], "each once"),
]


@pytest.mark.parametrize(("arguments", "word"), WRONG)
def test_wrong_input_is_one_line_and_code_2(work, capsys, arguments, word):
    text = (work / "table.csv").read_text()
    header, values = text.splitlines()[:2]
    first = values.partition(",")[0]
    (work / "broken.csv").write_text(f"{header}\n{values.replace(first, 'x', 1)}\n")
    (work / "short.csv").write_text("peak_mean,peak_rms\n1,2\n")
    (work / "long.csv").write_text(f"{header}\n{values},7\n")
    before = sorted(work.iterdir())
    assert cli.main(arguments) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[-1].startswith("learn: "), said
    assert word in said[-1]
    assert sorted(work.iterdir()) == before, "nothing was written"


@pytest.mark.few(1)
def test_every_command_works_on_every_population(
    population, tmp_path, monkeypatch, capsys
):
    """Databases of all generators, loads and grids are fitted, compared, asked and tabulated."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(population, "d.h5")
    with Reader(population) as reader:
        scene = reader.scene
    np.save("s.npy", np.random.default_rng(0).normal(size=scene.shape))
    side = ",".join(f"{each:g}" for each in scene.sides)
    hybrid = ["--features", "hybrid"]
    for line in (
        ["fit", "d.h5", "-o", "d.s", *hybrid, "--target", "area,force,contact_nodes"],
        ["card", "d.s"],
        ["predict", "d.s", "s.npy", "--side", side, "--delta", "1:2:2", "-o", "p.csv"],
        ["law", "d.s", "d.h5", "--surfaces", "2", "--csv", "predicted.csv"],
        [
            "law",
            "d.h5",
            "--solver",
            "--surfaces",
            "2",
            "--delta",
            "0.01",
            "--csv",
            "solved.csv",
        ],
        [
            "compare",
            "d.h5",
            "-o",
            "c",
            "--model",
            "decision-tree",
            "--features",
            "dimensionless",
        ],
        ["show", "c", "--no-pictures"],
        ["importance", "d.h5", "-o", "c2", "--model", "decision-tree"],
    ):
        assert cli.main(line) == 0, line
    shown = capsys.readouterr().out
    (nx, ny), (x, y) = scene.shape, scene.sides
    assert (
        f"{nx} x {ny} nodes, " + (f"side {x:g}" if x == y else f"sides {x:g} x {y:g}")
        in shown
    )
    assert " nodes, trained on" not in Path("p.csv").read_text(encoding="utf-8")


SIDE = ["--side", "1000"]
CONTACT = ["many/s0.npy", *SIDE, "--young", "5", "--poisson", "0.5"]
BODIES = [*CONTACT, "--hardness", "0.5", "--spots", "--stiffness", "--conductivity", "1"]
FULL = ["--boundary", "mirror", "--pressure", "1e-9,0.01,0.02,10,20,30"]
WRITERS = {
    "describe": [gen_cli, "describe", "many/s0.npy", *SIDE, "--csv", "out.csv"],
    "contact": [gen_cli, "contact", *CONTACT, *FULL, "--csv", "out.csv"],
    "spots": [gen_cli, "contact", *BODIES, "--delta", "1e-9,1,9,50", "--csv", "out.csv"],
    "law": [gen_cli, "law", *CONTACT, *FULL, "-o", "out"],
    "population": [gen_cli, "law", "many", *CONTACT[1:], *FULL, "--conductivity", "1", "-o", "out"],
    "predict": [cli, "predict", "hybrid.surrogate", "some", *SIDE, "--delta", "0.01,9,900",
                "-o", "out.csv"],
    "predicted": [cli, "law", "hybrid.surrogate", "many/s0.npy", *SIDE, "--delta", "0.01,9,900",
                  "--conductivity", "1", "-o", "out"],
    "columns": [gen_cli, "columns"],
    "compare": [cli, "compare", "database.h5", "-o", "out", "--model", "decision-tree"],
}  # fmt: skip


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.long] * (name == "compare"))
        for name in WRITERS
    ],
)
def test_a_strict_reader_takes_every_text_that_a_command_writes(work, capsys, name):
    """Numbers are finite, JSON is JSON, rows are as long as their header."""
    program, *words = WRITERS[name]
    Path("some").mkdir()
    shutil.copy("many/s0.npy", "some")
    np.save("some/ramp.npy", np.outer(np.arange(33.0), np.ones(33)))  # has no asperities
    assert program.main(words) == 0
    if name == "columns":
        Path("out.md").write_text(capsys.readouterr().out, encoding="utf-8")
    if name == "compare":
        for more in (
            ["show", "out"],
            ["importance", "database.h5", "-o", "out", *words[-2:]],
        ):
            assert cli.main(more) == 0
    readers = {".json": strict.json_of, ".csv": strict.rows_of, ".md": strict.markdown_of}
    texts = [path for path in work.rglob("*") if path.suffix in readers]
    written = [
        path for path in texts if path.relative_to(work).parts[0].startswith("out")
    ]
    assert written
    for path in written:
        readers[path.suffix](path)
