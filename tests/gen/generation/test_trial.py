"""Doubts about scenes and databases: slips are told by every command, what is meant by none."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from gen import cli
from gen.database import Reader, Writer, create
from gen.generation.sample import compute_rows, surface_numbered
from gen.generation.trial import doubts_after, doubts_before
from gen.runtime.errors import InputError
from gen.scene import Scene, load, preset_names
from gen.schema import Reason
from tests import user_functions
from tests.databases import deterministic_bytes

PATCH = "samples = 4\n[surface]\nnodes = 33\nside = 300\n"
PRESSURE = '[load]\nquantity = "pressure"\nrange = [50, 100]\n'
STEEL = "[contact]\nmodulus = 210e3\npoisson = 0.3\n"
SLIPS = {
    "no modulus": (PATCH + PRESSURE, "E* is 1 MPa, the default without a modulus"),
    "a force of 1e7": (
        f"{PATCH}[load]\nquantity = 'force'\nrange = 1e7\n",
        "E* is 1 MPa, the default without a modulus",
    ),
    "a Delta of 1000 um": (
        f"{PATCH}{STEEL}[delta]\nrange = 1000\n",
        "every node touches",
    ),
    "a side in mm": (PATCH.replace("300", "0.3") + PRESSURE + STEEL, "rms slope "),
    "a Delta in mm": (
        f"{PATCH}{STEEL}[delta]\nrange = [1e-3, 4e-3]\n",
        "one node touches at most",
    ),
    "a modulus in Pa": (
        PATCH + PRESSURE + STEEL.replace("e3", "e9"),
        "is the modulus in Pa?",
    ),
}
"""Slips of units, and a missing modulus: scenes, and what is told of them."""

NUMBER = re.compile(r"\d[\d.e+-]*")
OF_ROWS = re.compile(r"(, above 1)? in \d+ of \d+ (tried )?rows")


def wording(text: str) -> list[str]:
    """The warnings of a command, without numbers of rows and without values."""
    warnings = [
        line.partition("warning: ")[2] for line in text.splitlines() if "warning" in line
    ]
    return [NUMBER.sub("#", OF_ROWS.sub("", line)) for line in warnings]


COMMANDS = (
    "run slip.toml -o slip.h5 --dry-run",
    "estimate slip.toml",
    "run slip.toml -o slip.h5",
    "run slip.toml -o slip.h5 --rows 0:2",  # of a database that is there
    "info slip.h5",
    "check slip.h5 --recompute 1",
)


@pytest.mark.few(3)
@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("slip", SLIPS)
def test_commands_tell_a_slip_in_one_wording(slip, capsys):
    assert_told_in_one_wording(slip, COMMANDS, capsys)


@pytest.mark.few(1)
@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("slip", SLIPS)
def test_the_picture_comes_with_that_wording(slip, capsys):
    commands = "run slip.toml -o slip.h5", "info slip.h5", "plot slip.h5 -o slip.png"
    assert_told_in_one_wording(slip, commands, capsys)


def assert_told_in_one_wording(slip, commands, capsys):
    text, told = SLIPS[slip]
    Path("slip.toml").write_text(text)
    wordings = {}
    for line in commands:
        assert cli.main(line.split()) == 0
        output = "".join(capsys.readouterr())
        assert told in output, line
        wordings[line] = wording(output)
    assert len(wordings["info slip.h5"]) == 1
    assert len({tuple(lines) for lines in wordings.values()}) == 1


@pytest.mark.parametrize(
    ("slip", "options"),
    [
        ("no modulus", ["--pressure", "75"]),
        ("a force of 1e7", ["--force", "1e7"]),
        (
            "a Delta of 1000 um",
            ["--delta", "1000", "--young", "210e3", "--hardness", "2e3"],
        ),
        ("a side in mm", ["--pressure", "75", "--young", "210e3", "--hardness", "2e3"]),
    ],
)
def test_the_words_are_those_of_a_contact(slip, options, here, capsys):
    scene = Scene.parse(SLIPS[slip][0], "slip.toml")
    (line,) = wording("\n".join(f"warning: {doubt}" for doubt in doubts_before(scene, 4)))
    np.save("surface.npy", surface_numbered(scene, 0))
    side = str(scene.grid.sides[0])
    assert (
        cli.main(["contact", "surface.npy", "--side", side, *options, "--no-grid-error"])
        == 0
    )
    line = line.replace("(modulus in [contact])", "(--young or --e-star)")
    assert line in wording(capsys.readouterr().err)


@pytest.mark.usefixtures("here")
def test_a_law_of_a_scene_says_that_its_surfaces_are_steep(capsys):
    Path("slip.toml").write_text(SLIPS["a side in mm"][0])
    line = "law slip.toml --surfaces 2 --delta 2,4 --no-grid-error"
    assert cli.main(line.split()) == 0
    output = "".join(capsys.readouterr())
    assert "slip.toml: rms slope " in output
    assert "above 1 in 2 of 2 surfaces: the theory of the half-space" in output


@pytest.fixture
def database(path):
    """Make a database of the first rows of a scene."""

    def made(scene, rows=6):
        scene = scene.model_copy(update={"samples": rows})
        create(path, scene)
        with Writer(path, scene) as writer:
            writer.write_block(0, rows, compute_rows(scene, 0, rows))
        return Reader(path)

    return made


@pytest.mark.few(5)
@pytest.mark.parametrize("name", preset_names())
def test_no_shipped_scene_warns_but_that_of_the_corners(name, database):
    scene = load(name)
    with database(scene) as reader:
        doubts = [*doubts_before(scene, scene.samples), *doubts_after(reader)]
    if name == "extreme":
        assert [doubt.partition(" ")[0] for doubt in doubts] == ["rms", "rms"]
    else:
        assert doubts == []


def test_a_scene_of_steel_and_normalised_loads_are_not_doubted(database):
    normalised = PRESSURE.replace("[50, 100]", "{ log_uniform = [1e-3, 0.1] }")
    loads = PRESSURE.replace("[50, 100]", "{ log_uniform = [100.0, 2e4] }")
    for text in (PATCH + normalised, PATCH + STEEL + loads):
        scene = Scene.parse(text.replace("300", "1000"), "a.toml")
        assert doubts_before(scene, 4) == []


def test_a_trial_changes_no_byte_of_a_database(here, monkeypatch):
    Path("a.toml").write_text(PATCH)
    assert cli.main(["run", "a.toml", "-o", "tried.h5"]) == 0
    monkeypatch.setattr("gen.generation.run.doubts_before", lambda scene, rows: [])
    assert cli.main(["run", "a.toml", "-o", "plain.h5"]) == 0
    assert deterministic_bytes(Path("tried.h5")) == deterministic_bytes(Path("plain.h5"))
    assert Path("tried.h5").stat().st_size == Path("plain.h5").stat().st_size


def test_a_trial_costs_a_small_share_of_a_run(monkeypatch):
    """Three rows where rows are cheap, fewer of a short run of dear ones, none of huge ones."""
    tried = []

    def compute(scene, start, stop, limit):
        tried.append(start)
        raise InputError("nothing is computed here")

    monkeypatch.setattr("gen.generation.sample.compute_rows", compute)
    cases = (129, 3, 3), (257, 19, 0), (257, 40, 2), (257, 900, 3), (1025, 900, 0)
    for nodes, rows, most in cases:
        tried.clear()
        doubts_before(
            Scene.parse(f"samples = 900\nsurface.nodes = {nodes}", "a.toml"), rows
        )
        assert len(tried) == most


def test_pressures_are_judged_where_no_row_can_be_tried():
    text = PRESSURE + "[surface]\nnodes = 2049\n"
    (line,) = doubts_before(Scene.parse(f"samples = 30\n{text}", "a.toml"), 30)
    assert line.startswith("the largest nominal pressure is ")
    assert line.endswith(
        "E* is 1 MPa, the default without a modulus (modulus in [contact])"
    )


@pytest.mark.parametrize("hardness", ["8e3", "[2e3, 8e3]"])
def test_rows_whose_load_the_hardness_does_not_bear_are_counted_before_a_run(hardness):
    """As many as then fail; the largest load is that of the plan."""
    loads = PRESSURE.replace("[50, 100]", "{ log_uniform = [100.0, 2e4] }")
    text = f"{PATCH}{loads}{STEEL}hardness = {hardness}\n".replace("= 4", "= 40")
    scene = Scene.parse(text, "a.toml")
    columns = compute_rows(scene, 0, 40)
    failed = columns["reason"] == Reason.BEYOND_HARDNESS
    assert 0 < failed.sum() < 20
    (line,) = doubts_before(scene, 40)
    assert f"the load of {failed.sum()} of 40 rows, which will fail" in line
    assert f"reach {columns['load'][failed].max():.4g} MPa" in line


def test_of_a_long_plan_the_first_rows_are_counted():
    force = PRESSURE.replace("pressure", "force").replace("[50, 100]", "[1e6, 1e9]")
    text = f"{PATCH}{force}{STEEL}hardness = 2e3\n".replace("= 4", "= 4000")
    (line,) = doubts_before(Scene.parse(text, "a.toml"), 4)
    assert " of the first 1000 rows, which will fail" in line


@pytest.mark.usefixtures("untrusted")
def test_a_trial_calls_no_function_of_outputs_and_nothing_without_trust(
    here, refused, monkeypatch
):
    monkeypatch.setattr(sys, "path", list(sys.path))
    module = user_functions.MODULE.replace(
        "    _, number", "    raise MemoryError\n    _, number"
    )
    outputs = "outputs = { spots = '1', top = 'um', mean_pressure = 'uN' }\n"
    scene = f"samples = 4\n{user_functions.SURFACE}{user_functions.STORE}{outputs}"
    user_functions.write(here, scene, module)
    assert "runs only with --trust" in refused(
        cli, "run", "mine.toml", "-o", "a.h5", "--dry-run"
    )
    assert cli.main(["run", "mine.toml", "-o", "a.h5", "--dry-run", "--trust"]) == 0
    sys.modules.pop("mine", None)
