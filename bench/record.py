"""The places of a run's files, and the records of how, where and of which code parts were made.

A part is made again only if its record differs from the circumstances of today.
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
"""Packages whose versions a record has, if they are installed."""

ROOT = Path(__file__).resolve().parents[1]
"""Folder of the source tree."""

SOURCES = ("asperity", "bem", "bench", "gen", "learn")
"""Packages whose files are the code of a part."""

RESULTS = ROOT / "bench" / "results"
"""Folder of the published results."""

CODE = {".py", ".toml", ".jinja", ".html"}
"""Endings of the names of files that are code."""

COMPARED = {
    "command": "command",
    "inputs": "inputs",
    "state": "code",
    "versions": "packages",
    "machine": "machine",
}
"""Fields of a record that have to be as today for a part to stay, with their names in messages."""

RECORD = ".part.json"
"""End of the name of the file with the record of a part."""

NOT_READ = (RECORD, ".printed.txt", ".said.txt")
"""Ends of the names of files about how a part was made, which no other part reads."""

PAGE = "index.html"
"""Name of the page's file in the folder of a run."""


def circumstances() -> dict[str, Any]:
    """Describe the present: date, commit, state of the code, machine and versions of packages.

    Returns
    -------
    dict
        The fields `created`, `commit`, `state`, `machine` and `versions` of `Record`. The machine
        has more keys than `Machine`.
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
    """Hash all programs, settings and templates of the packages.

    Documents and published results do not change the hash. Changes that are not committed do.

    Parameters
    ----------
    root : Path
        Folder with the packages.

    Returns
    -------
    str
        SHA-256 of names and contents of the files, 64 hexadecimal digits.
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
    """Return the name of the processor, as Linux or else Python has it."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


class Machine(documents.Document):
    """The machine on which a part was made."""

    processor: str


class Record(documents.Document):
    """How a part was made, and how its command ended: a file in the folder of the part."""

    command: str  # as a user types it
    code: Annotated[int, Field(ge=-64, le=255)] = 0  # exit code; negative for a signal
    finished: bool = True  # whether the results are whole, also if a check failed
    # Wall-clock time of the command [s].
    seconds: Annotated[float, Field(ge=0, le=1e15)] = 0.0
    told: list[str] = Field(default_factory=list)  # last lines of standard error
    inputs: dict[str, int]  # last change of each input by its name [ns since 1970]
    created: str  # date and time (ISO 8601)
    commit: str  # empty without git
    state: str = ""  # of the code, as `code_state` returns it; empty in old records
    machine: Machine
    # Load of the machine in the minute before, near 0 if it was idle; None in old records.
    load: float | None = None
    versions: dict[str, str]  # of installed packages, by name


def _inputs_in(path: Path) -> Iterator[Path]:
    """Yield the files of an input: the file itself, or all files of a folder but `NOT_READ`."""
    if path.is_file():
        yield path
    elif path.is_dir():
        for file in path.rglob("*"):
            if file.is_file() and not file.name.endswith(NOT_READ):
                yield file


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
    document = documents.read(path, Record)
    if document is None:
        return None
    return Record.model_validate(document.content(), strict=False)


@dataclass(frozen=True)
class Inputs:
    """The places of the files that the parts of a run read and write."""

    output: Path  # folder of the run and of its page
    database: Path | None  # of the paper preset; None for the one in the run's folder
    comparison: (
        Path | None
    )  # of `learn compare` and `learn tune`; None for the run's folder
    full: bool  # True for all parts, False for the parts that fit into ten minutes

    @property
    def files(self) -> dict[str, Path]:
        """The files and folders that a part may read, by their names in commands."""
        return {
            "database": self.database or self.output / "databases" / "paper.h5",
            "comparison": self.comparison or self.output / "comparison",
        }

    def folder(self, part: Part) -> Path:
        """Return the folder of a part's files.

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
            The arguments of a short or of a full run; empty if this run leaves the part out.
        """
        return part.full if self.full else part.quick

    def arguments(self, part: Part) -> list[str]:
        """Return the arguments of the Python interpreter that make a part.

        Parameters
        ----------
        part : Part
            The part.

        Returns
        -------
        list of str
            The arguments; empty if this run leaves the part out. Words in brackets are left out if
            the file that they name does not exist, or the folder has no table.
        """

        def words_in_brackets(match: re.Match[str]) -> str:
            words, name = match.groups()
            path = self.files[name]
            if path.is_file() or any(path.glob("**/*.csv")):
                return words
            return ""

        template = re.sub(r"\[([^]]*\{(\w+)\})\]", words_in_brackets, self.template(part))
        values = {"folder": self.folder(part), **self.files}
        return [word.format_map(values) for word in template.split()]

    def command(self, part: Part, command: str) -> str:
        """Return a recorded command without the folder of another run.

        Parameters
        ----------
        part : Part
            The part.
        command : str
            The command that made the part, in this run or elsewhere.

        Returns
        -------
        str
            The command, with `report` in place of a run's folder that is not this run's.
        """
        own_folder = re.compile(rf"(.+)/{re.escape(part.folder or part.name)}(/.*)?")
        words = shlex.split(command)
        matches = [own_folder.fullmatch(word) for word in words]
        roots = {match[1] for match in matches if match}
        for root in roots - {str(self.output)}:
            beginning = re.compile(rf"^{re.escape(root)}(?=/)")
            words = [beginning.sub("report", word) for word in words]
        return shlex.join(words)

    def path(self, part: Part) -> Path:
        """Return the file of a part's record.

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
        """Return the files and folders that a part's command reads.

        Parameters
        ----------
        part : Part
            The part.

        Returns
        -------
        dict
            Paths by their names in commands, without the folder that the part writes.
        """
        names = re.findall(r"\{(\w+)\}", self.template(part))
        return {
            name: path
            for name, path in self.files.items()
            if name in names and path != self.folder(part)
        }

    def stale(self, part: Part) -> str:
        """Say why a part has to be made again.

        Parameters
        ----------
        part : Part
            The part.

        Returns
        -------
        str
            "new", "not finished", or "other ..." with a list of the changes since the part was
            made; "" if the part can stay.
        """
        record = read(self.path(part))
        if record is None:
            return "new"
        if not record.finished:
            return "not finished"
        then = record.model_dump()
        now = self._present(part)
        changes = [words for name, words in COMPARED.items() if then[name] != now[name]]
        if not changes:
            return ""
        return f"other {', '.join(changes)}"

    def write(self, part: Part, **outcome: Any) -> None:
        """Write the record of a part that was made just now.

        Parameters
        ----------
        part : Part
            The part.
        **outcome
            The fields `code`, `finished`, `seconds`, `told` and `load` of `Record`.
        """
        record = Record(**self._present(part), **outcome)
        text = record.model_dump_json(indent=2, exclude_unset=True)
        write(self.path(part), f"{text}\n")

    def _present(self, part: Part) -> dict[str, Any]:
        """Return the fields of a record that is made now: command, inputs and circumstances."""
        changed = {
            name: max((file.stat().st_mtime_ns for file in _inputs_in(source)), default=0)
            for name, source in self.sources(part).items()
        }
        return {"command": self.typed(part), "inputs": changed, **circumstances()}
