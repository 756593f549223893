"""The places of a run's files, and the records of how each part of a run was made.

A record is a JSON file in the folder of the part. It has the command, the exit code, the machine,
the state of the code and the versions of packages. A part is made again only if its record differs
from the present circumstances.
"""

import hashlib
import os
import platform
import re
import shlex
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from bench.report import Part
from gen.runtime import documents
from gen.runtime.files import write
from gen.runtime.installation import git_commit, versions

PACKAGES = (
    "asperity",
    "numpy",
    "scipy",
    "pyfftw",
    "h5py",
    "mpi4py",
    "scikit-learn",
    "xgboost",
    "xgboost-cpu",
    "ContactMechanics",
    "tamaas",
    "aspher",
)
"""Distributions whose versions are written into each record, if they are installed."""

ROOT = Path(__file__).resolve().parents[1]
"""Folder of the source tree."""

SOURCES = ("asperity", "bem", "bench", "gen", "learn")
"""Folders of the source tree whose files are hashed as the state of the code."""

RESULTS = ROOT / "bench" / "results"
"""Folder of the published results."""

CODE = {".py", ".toml", ".jinja", ".html"}
"""Suffixes of the files in `SOURCES` that are hashed: programs, settings and templates."""

COMPARED = {
    "command": "command",
    "inputs": "inputs",
    "state": "code",
    "versions": "packages",
    "machine": "machine",
}
"""Fields of `Record`, with their names in messages. A part is made again if one of them differs."""

RECORD = ".part.json"
"""Ending of the file of a part's record, after the name of the part."""

NOT_READ = (RECORD, ".printed.txt", ".said.txt")
"""Endings of files about how a part was made: its record, its standard output and its standard
error. They are no input of other parts."""

PAGE = "index.html"
"""Name of the file of the page, in the folder of a run."""


def circumstances() -> dict[str, Any]:
    """Describe the present: date, commit, state of the code, machine and versions of packages.

    Returns
    -------
    dict
        Values of the fields `created`, `commit`, `state`, `machine` and `versions` of `Record`, by
        their names. `machine` is a dict with the keys `processor`, `cores`, `system` and `threads`
        (the environment's OMP_NUM_THREADS).
    """
    return {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": git_commit(),
        "state": code_state(),
        "machine": {
            "processor": processor(),
            "cores": os.cpu_count(),
            "system": platform.platform(),
            "threads": os.environ.get("OMP_NUM_THREADS", "not set"),
        },
        "versions": versions(PACKAGES),
    }


def code_state(root: Path = ROOT) -> str:
    """Hash all files of `SOURCES` that have a suffix of `CODE`.

    Published results are left out. Changes that are not committed to git change the hash, too.

    Parameters
    ----------
    root : Path
        Folder with the packages.

    Returns
    -------
    str
        SHA-256 of the relative paths and contents of the files, 64 hexadecimal digits.
    """
    results = root / RESULTS.relative_to(ROOT)
    files = [path for package in SOURCES for path in (root / package).rglob("*")]
    digest = hashlib.sha256()
    for path in sorted(files):
        if path.suffix not in CODE or path.is_relative_to(results):
            continue
        content = path.read_bytes()
        digest.update(f"{path.relative_to(root).as_posix()} {len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def processor() -> str:
    """Return the name of the processor from /proc/cpuinfo, or from Python where that fails."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


class Machine(documents.Document):
    """The machine on which a part was made. Records may have further keys, which are kept."""

    processor: str  # name of the processor


class Record(documents.Document):
    """How a part was made, and how its command ended: a file in the folder of the part."""

    command: str  # as a user types it
    # Exit code of the command; the negative number of a signal that ended it.
    code: Annotated[int, Field(ge=-64, le=255)] = 0
    # True if all results were written, even if a check of them failed.
    finished: bool = True
    # Wall-clock time of the command [s].
    seconds: Annotated[float, Field(ge=0, le=1e15)] = 0.0
    # The last lines that the command wrote to standard error.
    told: list[str] = Field(default_factory=list)
    # Time of the last change of each input [ns since 1970], by its name in `Inputs.files`.
    inputs: dict[str, int]
    created: str  # date and time of the end of the command (ISO 8601)
    commit: str  # hash of the git commit; empty without git
    state: str = ""  # state of the code from `code_state`; empty in old records
    machine: Machine
    # Load average of the machine in the minute before, near 0 if it was idle; None in old records.
    load: float | None = None
    versions: dict[str, str]  # versions of the installed `PACKAGES`, by their names


def _inputs_in(path: Path) -> Iterator[Path]:
    """Yield the files of an input: the file itself, or the files below a folder.

    Files with the endings `NOT_READ` are left out. Nothing is yielded if the path does not exist.
    """
    if path.is_file():
        yield path
    elif path.is_dir():
        for file in path.rglob("*"):
            if file.is_file() and not file.name.endswith(NOT_READ):
                yield file


def missing_packages(part: Part, record: Record) -> list[str]:
    """List the packages that a part needs for all of its rows, and that were not installed.

    Parameters
    ----------
    part : Part
        The part.
    record : Record
        The record of how it was made.

    Returns
    -------
    list of str
        Names of distributions in `PACKAGES`; records do not tell which programs were installed.
    """
    packages = [name for name in part.needs if name in PACKAGES]
    return [name for name in packages if name not in record.versions]


def read(path: Path) -> Record | None:
    """Read a record.

    Parameters
    ----------
    path : Path
        The file of the record.

    Returns
    -------
    Record or None
        The record; None if the file does not exist.

    Raises
    ------
    InputError
        If the file is damaged.
    """
    return documents.read(path, Record)


@dataclass(frozen=True)
class Inputs:
    """The places of the files that the parts of a run read and write."""

    output: Path  # folder of the run, which has the page and a folder for each part
    # The user's database of the paper preset; None for the generated one in the run's folder.
    database: Path | None
    # The user's folder of `learn compare` and `learn tune`; None for the one in the run's folder.
    comparison: Path | None
    full: bool  # True for a full run; False for a short run, of ten minutes

    @property
    def files(self) -> dict[str, Path]:
        """The database and the folder of the comparison, by their names in commands' templates.

        They may not exist.
        """
        return {
            "database": self.database or self.output / "databases" / "paper.h5",
            "comparison": self.comparison or self.output / "comparison",
        }

    def folder(self, part: Part) -> Path:
        """Return the folder of a part's files: that of the comparison, or one in the run's folder.

        Parameters
        ----------
        part : Part
            The part.

        Returns
        -------
        Path
            The folder, which may not exist.
        """
        name = part.folder or part.name
        if name == "comparison":
            return self.files["comparison"]
        return self.output / name

    def template(self, part: Part) -> str:
        """Return the arguments of a part's command before they are filled in.

        Parameters
        ----------
        part : Part
            The part.

        Returns
        -------
        str
            `part.full` in a full run, `part.quick` in a short one; empty if this run leaves the
            part out.
        """
        return part.full if self.full else part.quick

    def arguments(self, part: Part) -> list[str]:
        """Fill in the template of a part's command.

        Parameters
        ----------
        part : Part
            The part.

        Returns
        -------
        list of str
            The arguments of the Python interpreter; empty if this run leaves the part out. Words in
            brackets are kept, without the brackets, only if the file that they name exists or the
            folder that they name has a table.
        """

        def words_to_keep(match: re.Match[str]) -> str:
            """Return the words in brackets, or "" if their file or folder has nothing."""
            words, name = match.groups()
            path = self.files[name]
            if path.is_file() or any(path.glob("**/*.csv")):
                return words
            return ""

        # Words in brackets end with the name of one of `files`: "[--comparison {comparison}]".
        in_brackets = r"\[([^]]*\{(\w+)\})\]"
        template = re.sub(in_brackets, words_to_keep, self.template(part))
        values = {"folder": self.folder(part), **self.files}
        return [word.format_map(values) for word in template.split()]

    def portable(self, part: Part, recorded: str) -> str:
        """Return a recorded command, with `report` in place of the folder of another run.

        Parameters
        ----------
        part : Part
            The part that the command made.
        recorded : str
            The command, from a record of this run or of another one.

        Returns
        -------
        str
            The command, with `asperity` in place of `python -m` for gen, learn and bench. The
            folder of this run is not replaced.
        """
        words = shlex.split(recorded)
        # The folder of a run is the part ROOT of a word ROOT/PART or ROOT/PART/...
        folder_of_part = re.compile(rf"(.+)/{re.escape(part.folder or part.name)}(/.*)?")
        matches = [folder_of_part.fullmatch(word) for word in words]
        run_folders = {match[1] for match in matches if match}
        other_folders = run_folders - {str(self.output)}
        for folder in other_folders:
            beginning = re.compile(rf"^{re.escape(folder)}(?=/)")
            words = [beginning.sub("report", word) for word in words]
        return re.sub(
            r"^python -m (?=(gen|learn|bench) )", "asperity ", shlex.join(words)
        )

    def path(self, part: Part) -> Path:
        """Return the path of a part's record.

        Parameters
        ----------
        part : Part
            The part.

        Returns
        -------
        Path
            The file, which may not exist.
        """
        return self.folder(part) / f"{part.name}{RECORD}"

    def typed(self, part: Part) -> str:
        """Return a part's command as a user types it.

        Parameters
        ----------
        part : Part
            The part.

        Returns
        -------
        str
            The command, quoted for a shell.
        """
        return shlex.join(["python", *self.arguments(part)])

    def sources(self, part: Part) -> dict[str, Path]:
        """Return those of `files` that a part's command names.

        Parameters
        ----------
        part : Part
            The part.

        Returns
        -------
        dict
            Paths by their names in the template. The folder into which the part itself writes is
            left out.
        """
        names = re.findall(r"\{(\w+)\}", self.template(part))
        return {
            name: path
            for name, path in self.files.items()
            if name in names and path != self.folder(part)
        }

    def stale(self, part: Part) -> str:
        """Return the reason why a part has to be made again.

        Parameters
        ----------
        part : Part
            The part.

        Returns
        -------
        str
            "new" without a record, "not finished", or "other ..." with the names in `COMPARED` of
            the fields that have changed, as "other code, packages"; "" if the part can stay.

        Raises
        ------
        InputError
            If the record is damaged.
        """
        record = read(self.path(part))
        if record is None:
            return "new"
        if not record.finished:
            return "not finished"
        recorded = record.model_dump()
        present = self._present(part)
        changes = [
            words
            for field, words in COMPARED.items()
            if recorded[field] != present[field]
        ]
        if not changes:
            return ""
        return f"other {', '.join(changes)}"

    def write(self, part: Part, **outcome: Any) -> None:
        """Write the record of a part that was made just now into the folder of the part.

        Parameters
        ----------
        part : Part
            The part.
        **outcome
            Values of the fields `code`, `finished`, `seconds`, `told` and `load` of `Record`. The
            method itself finds the values of the other fields.
        """
        record = Record(**self._present(part), **outcome)
        text = record.model_dump_json(indent=2, exclude_unset=True)
        write(self.path(part), f"{text}\n")

    def _present(self, part: Part) -> dict[str, Any]:
        """Return values of the fields of a record that do not depend on the outcome, by name.

        The time of an input without files is 0.
        """
        last_changes = {}
        for name, source in self.sources(part).items():
            changes = [file.stat().st_mtime_ns for file in _inputs_in(source)]
            last_changes[name] = max(changes, default=0)
        return {"command": self.typed(part), "inputs": last_changes, **circumstances()}
