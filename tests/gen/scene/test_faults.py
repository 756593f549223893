"""Messages about scenes that break a rule, in every command that reads them."""

from pathlib import Path

import pytest

from gen import cli
from gen.runtime.errors import InputError
from gen.scene import Scene, differences


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("key", ["contact.young", "sample", "load.min"])
def test_run_and_dry_run_print_the_same_line(key, refused):
    """Keys that are missing because another one is misspelt are not counted."""
    start = "" if key == "sample" else "samples = 3\n"
    Path("slip.toml").write_text(f"{start}{key} = 5\n")
    line = refused(cli, "run", "slip.toml", "-o", "a.h5")
    assert line == refused(cli, "run", "slip.toml", "-o", "a.h5", "--dry-run")
    assert "more)" not in line


RANGE = "delta.range = [1.0, 4.0]"
PIECES = "delta.pieces = [{ share = 1.0, range = [1.0, 4.0] }]"


def test_a_range_of_delta_is_one_piece():
    ranged = Scene.parse(f"samples = 3\n{RANGE}", "a.toml")
    pieces = Scene.parse(f"samples = 3\n{PIECES}", "a.toml")
    assert ranged == pieces
    assert ranged.fingerprint() == pieces.fingerprint()
    assert differences(ranged, pieces) == []


def test_a_range_beside_pieces_is_refused():
    with pytest.raises(
        InputError, match="delta: range and pieces are both given: give one"
    ):
        Scene.parse(f"samples = 3\n{PIECES}\n{RANGE}", "a.toml")


@pytest.fixture
def two_databases(here, capsys):
    """Databases one.h5 and other.h5 of two scenes, one.toml and other.toml."""
    for name, seed in (("one", 1), ("other", 2)):
        Path(f"{name}.toml").write_text(
            f"samples = 2\nseed = {seed}\n[surface]\nnodes = 9\nside = {seed}00.0\n"
        )
        assert cli.main(["run", f"{name}.toml", "-o", f"{name}.h5"]) == 0
    capsys.readouterr()
    return here


@pytest.mark.usefixtures("two_databases")
def test_a_run_lists_what_differs_from_the_scene_of_its_database(capsys):
    assert cli.main(["run", "other.toml", "-o", "one.h5"]) == 2
    assert capsys.readouterr().err.splitlines() == [
        "gen: one.h5 holds another scene; give another name, or the file's own scene:",
        "  seed: 1 in the file, 2 asked for",
        "  surface.side: 100.0 in the file, 200.0 asked for",
    ]


@pytest.mark.usefixtures("two_databases")
def test_a_merge_lists_what_differs_between_the_scenes(capsys):
    assert cli.main(["merge", "one.h5", "other.h5", "-o", "both.h5"]) == 2
    assert capsys.readouterr().err.splitlines() == [
        "gen: one.h5 and other.h5 hold different scenes, and are not merged:",
        "  seed: 1 in one.h5, 2 in other.h5",
        "  surface.side: 100.0 in one.h5, 200.0 in other.h5",
    ]
