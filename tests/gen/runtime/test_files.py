"""Files that commands write: never over an input, an output or another kind, and always whole."""

import fcntl
import os
import resource
import shutil
import signal
import stat
import subprocess
import sys
import textwrap
from unittest import mock

import numpy as np
import pytest
from databases import database_of

from bench.commands import main as bench
from gen import cli
from gen.runtime import files
from gen.runtime.errors import InputError
from gen.runtime.figure import new_figure, save
from gen.runtime.files import Output, check_outputs, lock, lock_folder
from gen.surface import generate
from learn import cli as learn

CONTACT = ["contact", "h.npy", "--side", "9", "--delta", "1"]
LAW = ["law", "model.surrogate", "h.npy"]

REPLACED = {
    "h.npy": b"\x93NUMPY\x01\x00v\x00",
    "rows.h5": b"\x89HDF\r\n\x1a\n\x02",
    "old.png": b"\x89PNG\r\n\x1a\n",
    "table.csv": b"a,b\n1,2\n",
}


@pytest.fixture
def folder(here):
    """A surface, files of several kinds, links to them, and what no command may write to."""
    for name, content in REPLACED.items():
        (here / name).write_bytes(content)
    np.save("h.npy", np.arange(81.0).reshape(9, 9))
    (here / "heights.txt").write_text("0 1\n1 0\n")
    os.link("heights.txt", "hard.txt")
    (here / "same.csv").symlink_to("table.csv")
    (here / "loop.csv").symlink_to("loop.csv")
    os.mkfifo("fifo.csv")
    (here / "locked.csv").write_text("a\n")
    (here / "locked.csv").chmod(0o444)
    return here


def contents(folder):
    return {
        (each.name, each.lstat().st_mtime_ns): each.read_bytes()
        if each.is_file()
        else b""
        for each in folder.iterdir()
    }


REFUSED = [
    (cli, [*CONTACT, "--csv", "h.npy"], "is an input"),
    (cli, ["describe", "heights.txt", "--side", "9", "--csv", "hard.txt"], "is an input"),
    (cli, ["plot", "rows.h5", "-o", "rows.h5"], "is an input"),
    (cli, [*CONTACT, "--csv", "rows.h5"], "of the kind database, not text"),
    (
        cli,
        [*CONTACT, "--csv", "new.svg", "--plot", "new.svg"],
        "is what --csv writes too",
    ),
    (cli, [*CONTACT, "--csv", "locked.csv"], "is read-only"),
    (cli, [*CONTACT, "--csv", "fifo.csv"], "is no regular file"),
    (cli, [*CONTACT, "--csv", "loop.csv"], "loop"),
    (cli, [*CONTACT, "--csv", "nowhere/law.csv"], "folder that exists"),
    (
        learn,
        [*LAW, "--csv", "same.csv", "--header", "table.csv"],
        "is what --csv writes too",
    ),
    (learn, ["fit", "rows.h5", "-o", "rows.h5"], "is an input"),
    (learn, ["compare", "rows.h5", "-o", "table.csv"], "is a file: give a folder"),
]


@pytest.mark.parametrize(("program", "arguments", "word"), REFUSED)
def test_refused_before_any_work(folder, refused, monkeypatch, program, arguments, word):
    failing = mock.Mock(side_effect=AssertionError("worked before the refusal"))
    monkeypatch.setattr("gen.maps.bodies.read", failing)
    before = contents(folder)
    assert word.lower() in refused(program, *arguments).lower()
    assert contents(folder) == before


def test_reports_find_out_before_they_measure(folder, capsys):
    report = folder / "report"
    report.mkdir()
    (report / "growth.csv").write_bytes(REPLACED["rows.h5"])
    assert bench(["growth", "-o", str(report)]) == 2
    assert "not text" in capsys.readouterr().err.splitlines()[-1]
    assert [*contents(report).values()] == [REPLACED["rows.h5"]]


@pytest.fixture
def replaced(folder, capsys):
    """The folder after a command that wrote a table and a picture by links to older ones."""
    (folder / "old.png").chmod(0o640)
    (folder / "link.png").symlink_to("old.png")
    assert cli.main([*CONTACT, "--csv", "same.csv", "--plot", "link.png"]) == 0
    return folder


def test_a_file_of_the_same_kind_is_replaced(replaced):
    assert (replaced / "old.png").stat().st_size > 1000
    assert (replaced / "table.csv").read_text().startswith("delta_um,")


def test_a_link_to_a_file_that_is_replaced_stays_a_link(replaced):
    assert (replaced / "link.png").is_symlink()
    assert (replaced / "same.csv").is_symlink()


def test_a_file_passes_on_its_mode_to_the_one_that_replaces_it(replaced):
    assert stat.S_IMODE((replaced / "old.png").stat().st_mode) == 0o640


def test_no_unfinished_file_is_left(replaced):
    assert not list(replaced.glob(".asperity-*"))


def test_a_full_disk_keeps_the_old_picture(folder):
    figure = new_figure(4, 3)
    before = contents(folder)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(
            InputError, match=r"old.png cannot be written: File too large"
        ):
            save(figure, folder / "old.png")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    assert contents(folder) == before


def test_a_file_is_on_the_disk_before_it_takes_its_name(tmp_path, monkeypatch):
    target, synced, sync = tmp_path / "rows.csv", [], os.fsync

    def noted(descriptor):
        sync(descriptor)
        synced.append((os.fstat(descriptor).st_size, target.exists()))

    monkeypatch.setattr(os, "fsync", noted)
    files.write(target, "a,b\n")
    assert synced == [(4, False)]


@pytest.mark.parametrize(
    ("present", "left"), [("replace", "ours"), ("keep", "theirs"), ("refuse", "theirs")]
)
def test_a_file_that_appears_meanwhile_is_replaced_only_if_it_may_be(
    tmp_path, present, left
):
    target = tmp_path / "rows.h5"

    def make():
        with files.unfinished(target, present, b"signature") as made:
            assert made.parent == tmp_path
            made.write_text("ours")
            target.write_text("theirs")

    if present == "refuse":
        with pytest.raises(FileExistsError):
            make()
    else:
        make()
    assert target.read_text() == left
    assert [each.name for each in tmp_path.iterdir()] == ["rows.h5"]


def test_files_in_an_input_folder_are_inputs(folder):
    (folder / "heights.csv").write_text("0,1\n1,0\n")
    (folder / "points.csv").write_text("x,y,z\n1,0,2\n")
    for name in ("heights.txt", "hard.txt", "heights.csv", "points.csv", "table.csv"):
        with pytest.raises(InputError, match="is an input"):
            check_outputs([Output(folder / name, "-o")], [folder])


def test_no_link_leads_out_of_a_folder_for_names_of_ours(folder):
    own = folder / "own"
    own.mkdir()
    for name, target in (
        ("a", folder / "hard.txt"),
        ("b", "../none"),
        ("c", "c"),
        ("d", folder),
    ):
        (own / name).symlink_to(target)
        with pytest.raises(InputError, match="leads out of"):
            files.inside(own, f"{name}/x" if name == "d" else name)
    (own / "near").symlink_to("other")
    assert files.inside(own, "near") == own / "near"


def test_an_empty_file_and_the_same_kind_are_replaced(folder):
    (folder / "empty").touch()
    for kind in ("text", "picture", "surrogate", "heights", "arrays"):
        check_outputs([Output(folder / "empty", "-o", kind)])
    np.savez(folder / "arrays", a=np.ones(2))
    for name, kind, other in (
        ("arrays.npz", "arrays", "surrogate"),
        ("h.npy", "heights", "text"),
    ):
        check_outputs([Output(folder / name, "-o", kind)])
        with pytest.raises(InputError, match=f"of the kind {kind}, not {other}"):
            check_outputs([Output(folder / name, "-o", other)])


SURFACE = ["h.npy", "--side", "9"]
WRITERS = {
    "run": (cli, ["run", "small.toml", "-o", "link.h5"]),
    "export": (cli, ["export", "small.h5", "-o", "link"]),
    "scene": (cli, ["scene", "--like", "map.npy", "--side", "9", "-o", "link.toml"]),
    "table": (cli, ["describe", *SURFACE, "--csv", "link.csv"]),
    "picture": (cli, ["describe", *SURFACE, "--plot", "link.png"]),
    "fit": (learn, ["fit", "small.h5", "--features", "paper", "-o", "link.surrogate"]),
}
"""A command for each way in which files are written."""


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A scene, its database of 30 rows and a surface."""
    folder = tmp_path_factory.mktemp("small")
    database_of(folder, "samples = 30\n[surface]\nnodes = 9\n", "small")
    np.save(
        folder / "map.npy", generate("midpoint", 129, 0.8, 1.0, np.random.default_rng(0))
    )
    np.save(folder / "h.npy", np.arange(81.0).reshape(9, 9))
    return folder


@pytest.mark.few(4)
@pytest.mark.parametrize("name", WRITERS)
def test_a_link_to_what_does_not_exist_yet_is_followed(
    small, tmp_path, monkeypatch, name
):
    """As on clusters, where results stand on a scratch disk."""
    program, line = WRITERS[name]
    work, scratch = tmp_path / "work", tmp_path / "scratch"
    shutil.copytree(small, work)
    scratch.mkdir()
    link = work / line[-1]
    link.symlink_to(scratch / "new")
    monkeypatch.chdir(work)
    assert program.main(line) == 0
    assert link.is_symlink()
    assert [each.name for each in scratch.iterdir()] == ["new"]
    assert link.is_dir() or (scratch / "new").stat().st_size > 0


@pytest.mark.parametrize("name", ["run", "table", "export"])
def test_a_link_onto_an_input_or_itself_is_refused(small, here, refused, name):
    program, line = WRITERS[name]
    shutil.copytree(small, here, dirs_exist_ok=True)
    link = here / line[-1]
    onto = here / {"table": "h.npy", "run": "small.toml"}.get(name, "small.h5")
    content = onto.read_bytes()
    for target in (onto.name, link.name):
        link.symlink_to(target)
        refused(program, *line)
        assert onto.read_bytes() == content
        link.unlink()


def test_two_links_to_one_new_file_are_one_output(folder, refused):
    for name in ("one.csv", "two.png"):
        (folder / name).symlink_to("new")
    line = ["describe", *SURFACE, "--csv", "one.csv", "--plot", "two.png"]
    assert "is what --csv writes too" in refused(cli, *line)
    assert not (folder / "new").exists()


HELD_ELSEWHERE = """
    import sys
    from pathlib import Path
    from gen.runtime.files import lock
    with lock(Path(sys.argv[1])):
        print("held", flush=True)
        sys.stdin.read()
"""


@pytest.fixture
def holder(path, monkeypatch):
    """A process of a batch job that holds the lock of a path until it is killed."""
    command = [sys.executable, "-c", textwrap.dedent(HELD_ELSEWHERE), str(path)]
    monkeypatch.setenv("SLURM_JOB_ID", "4711")
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_second_writer_is_told_who_writes(path, holder):
    with pytest.raises(InputError) as raised, lock(path):
        pass
    assert f"process {holder.pid}, job 4711, since 20" in str(raised.value)
    assert os.uname().nodename in str(raised.value)


def test_a_killed_holder_holds_nothing_though_its_file_is_still_there(path, holder):
    holder.kill()
    holder.wait()
    assert path.with_name("some.h5.lock").exists()
    with lock(path):
        assert f"process {os.getpid()}" in path.with_name("some.h5.lock").read_text()


def test_the_file_of_a_lock_is_removed_with_it(path):
    with lock(path):
        assert path.with_name("some.h5.lock").exists()
    assert list(path.parent.iterdir()) == []


def test_lock_is_one_for_all_names_of_a_file(path, tmp_path):
    link = tmp_path / "link.h5"
    link.symlink_to(path)
    with lock(path), pytest.raises(InputError, match="is being written"), lock(link):
        pass


def test_lock_survives_a_rival_that_unlinks_in_between(path, monkeypatch):
    """The holder before us ends between our open and our lock: ours must not be of a ghost."""
    lock_path = path.with_name("some.h5.lock")
    flock = fcntl.flock
    opened = []

    def unlink_first_time(descriptor, operation):
        if not opened:
            lock_path.unlink()
        opened.append(descriptor)
        return flock(descriptor, operation)

    monkeypatch.setattr(fcntl, "flock", unlink_first_time)
    with lock(path):
        assert len(opened) == 2
        with pytest.raises(InputError, match="is being written"), lock(path):
            pass


def test_file_system_without_locks(path, monkeypatch):
    failing = mock.Mock(side_effect=OSError(38, "Function not implemented"))
    monkeypatch.setattr(fcntl, "flock", failing)
    with pytest.raises(InputError, match="HDF5_USE_FILE_LOCKING=FALSE"), lock(path):
        pass
    monkeypatch.setenv("HDF5_USE_FILE_LOCKING", "FALSE")
    with lock(path):
        pass


@pytest.fixture(
    params=["new", "of several levels", "of the user's", "a link to a new one"]
)
def output_folder(request, tmp_path):
    """A folder that a command is to write to; only that of the user's exists."""
    folder = tmp_path / "a"
    if request.param == "of several levels":
        return folder / "b"
    if request.param == "of the user's":
        folder.mkdir()
    if request.param == "a link to a new one":
        folder.symlink_to("place")
    return folder


def test_a_folder_has_one_writer_at_a_time(output_folder):
    again = pytest.raises(InputError, match="is being written by host")
    with lock_folder(output_folder), again, lock_folder(output_folder):
        pass


def test_a_folder_that_stays_empty_is_removed_unless_it_was_there(
    output_folder, tmp_path
):
    before = {path.name for path in tmp_path.iterdir()}
    with lock_folder(output_folder):
        assert output_folder.is_dir()
    assert {path.name for path in tmp_path.iterdir()} == before


def test_a_folder_that_is_used_stays_with_its_content_alone(output_folder):
    with lock_folder(output_folder):
        (output_folder / "result").write_text("1")
    assert [path.name for path in output_folder.iterdir()] == ["result"]
