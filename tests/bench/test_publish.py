"""What a run has made goes into the results whole."""

import lzma
import shutil

import pytest
from page_parts import WRITE, inputs, makes, part, written

from bench.commands import main
from bench.contents import Figure, Table
from bench.picture import new_figure, save
from bench.publish import publish
from bench.record import RESULTS
from bench.report import Part
from gen.runtime.errors import InputError


def pictured(folder):
    """Files of each kind: shown and not, large, inside of a folder that stays behind."""
    small = written("small.csv", [["x"], [1]], folder)
    written("large.csv", [["x"], *([n] for n in range(60_000))], folder)
    for inside in ("databases", "library"):
        written("inside.csv", [["x"], [1]], folder / inside)
    (folder / "data.h5").write_bytes(b"\x89HDF")
    (folder / "trials.jsonl").write_text("{}\n")
    save(new_figure(1, 1), folder / "other.png")
    picture = save(new_figure(1, 1), folder / "shown.png")
    return [Figure(picture, "Nothing.", data=(small,)), Table(small, "")]


@pytest.fixture
def made(tmp_path):
    makes(tmp_path / "report", [part("one", WRITE), PICTURED])
    return tmp_path / "report"


ONE = part("one", WRITE)
PICTURED = Part("two", "Chapter", "Two", WRITE, WRITE, pictured)


def published(made, parts):
    target = made.parent / "results"
    paths = publish(parts, inputs(made, full=True), target)
    return [path.relative_to(target).as_posix() for path in paths]


def test_what_is_shown_and_behind_it_is_published(made):
    assert published(made, [ONE, PICTURED]) == [
        *("one/made.txt", "one/one.part.json", "two/large.csv.xz", "two/made.txt"),
        *("two/shown.png", "two/small.csv", "two/trials.jsonl.xz", "two/two.part.json"),
    ]
    large = made.parent / "results" / "two" / "large.csv.xz"
    assert (
        lzma.decompress(large.read_bytes()) == (made / "two" / "large.csv").read_bytes()
    )
    record = (made.parent / "results" / "one" / "one.part.json").read_text()
    assert "report/one" in record
    assert str(made) not in record


def test_a_folder_made_anew_loses_what_it_held_and_others_do_not(made):
    results = made.parent / "results"
    stale = written("stale.csv", [["x"], [1]], results / "one")
    other = written("other.csv", [["x"], [1]], results / "three")
    for _ in range(2):  # the second time all of it is there
        published(made, [ONE, PICTURED])
    assert not stale.exists()
    assert other.exists()
    stale = written("stale.csv", [["x"], [1]], results / "one")
    beside = Part("beside", "Chapter", "Beside", WRITE, WRITE, pictured, folder="one")
    published(made, [ONE, beside, PICTURED])
    assert stale.exists(), "another part of this folder was not made"


@pytest.mark.parametrize("target", ["one", "..", "link"])
def test_what_is_read_is_not_written_over(made, target):
    (made / "link").symlink_to(made)
    before = {
        path: path.read_bytes() for path in made.parent.rglob("*") if path.is_file()
    }
    with pytest.raises(InputError, match="is read, give a folder apart from it"):
        publish([ONE, PICTURED], inputs(made, full=True), made / target)
    after = {path: path.read_bytes() for path in made.parent.rglob("*") if path.is_file()}
    assert after == before


def test_parts_that_were_not_finished_are_refused(tmp_path):
    failing = part("failing", "-m bench cost")
    makes(tmp_path / "report", [failing])
    with pytest.raises(InputError, match="failing was not finished"):
        published(tmp_path / "report", [failing])


def test_command_says_that_there_is_nothing_to_publish(tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "report").mkdir()
    assert main(["publish", "report", "results"]) == 2
    assert "holds no finished part" in capfd.readouterr().err


def test_command_publishes_finished_parts(tmp_path, capfd, monkeypatch):
    """A part as a run leaves it, with what its command has printed."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(RESULTS / "hertz", tmp_path / "report" / "hertz")
    (tmp_path / "report" / "hertz" / "hertz.printed.txt").write_text("printed")
    assert main(["publish", "report", "results"]) == 0
    assert sorted(capfd.readouterr().out.split()) == [
        f"results/hertz/{name}" for name in ("hertz.csv", "hertz.part.json", "hertz.png")
    ]
