"""Where the files of a run are, and how each part was made: on which machine, of which code.

Records are compared before a part is made again.
"""

import hashlib
import os
import platform
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
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
    *("asperity", "numpy", "scipy", "pyfftw", "h5py", "mpi4py", "scikit-learn", "xgboost"),
    *("xgboost-cpu", "ContactMechanics", "tamaas", "aspher"),
)
"""Packages whose versions are written down where they are installed."""

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("asperity", "bem", "bench", "gen", "learn")
RESULTS = ROOT / "bench" / "results"
CODE = frozenset({".py", ".toml", ".jinja", ".html"})
"""Ends of the names of files that a state of the code consists of."""


def circumstances() -> dict[str, Any]:
    """Return date, commit, state of the code, machine and versions of packages."""
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


def load() -> float:
    """Return how many processes ran or waited on average in the last minute; quiet is near 0."""
    return round(os.getloadavg()[0], 2)


def code_state(root: Path = ROOT) -> str:
    """Return a hash of the code, which documents and results do not change.

    It is that of the sorted paths and contents of all programs, settings and templates of the
    packages under a folder, so it needs no git, and sees what is not committed.
    """
    digest = hashlib.sha256()
    files = (path for name in SOURCES for path in (root / name).rglob("*"))
    results = root / RESULTS.relative_to(ROOT)
    code = (path for path in files if path.suffix in CODE and not path.is_relative_to(results))
    for path in sorted(code):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(root).as_posix()} {len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def processor() -> str:
    """Return the processor's name as Linux tells it, else as Python does."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


SAME = {"command": "command", "inputs": "inputs", "state": "code", "versions": "packages"}
SAME |= {"machine": "machine"}  # what has to be as it was for something to stay, in words
# Ends of the names of files that record how a part was made; no part reads them.
NOT_READ = (".part.json", ".printed.txt")
PAGE = "index.html"


class Machine(documents.Document):
    """The machine on which something was made."""

    processor: str


class Record(documents.Document):
    """The record of something that was made: see `Making`."""

    command: str
    code: Annotated[int, Field(ge=-64, le=255)] = 0
    finished: bool = True
    seconds: Annotated[float, Field(ge=0, le=1e15)] = 0.0
    told: list[str] = Field(default_factory=list)
    inputs: dict[str, int]
    created: str
    commit: str
    state: str = ""  # of the code; empty in records of before it was written down
    machine: Machine
    load: float | None = None  # of the machine in the minute before; quiet is near 0
    versions: dict[str, str]


@dataclass(frozen=True)
class Making:
    """A result that a command makes from inputs, and that stays while these do not change.

    The record (`path`) is in the folder of what is made; `sources` are the files and folders that
    the command reads, by name.
    """

    path: Path
    command: str
    sources: Mapping[str, Path]

    def stale(self) -> str:
        """Say why this has to be made, "" if it stays: what has changed since the record."""
        found = read(self.path)
        if found is None or not found.finished:
            return "new" if found is None else "not finished"
        then = found.model_dump()
        now = circumstances() | {"command": self.command, "inputs": self._stamps()}
        changed = [said for name, said in SAME.items() if then[name] != now[name]]
        return f"other {', '.join(changed)}" if changed else ""

    def write(self, **said: Any) -> None:
        """Write the record; `said` are the fields of `Record` that are not known here."""
        known = {"command": self.command, "inputs": self._stamps(), **circumstances()}
        record = Record(**known, **said)
        write(self.path, record.model_dump_json(indent=2, exclude_unset=True) + "\n")

    def _stamps(self) -> dict[str, int]:
        """Return when each input was changed last [ns]; 0 for a missing one."""
        return {
            name: max((file.stat().st_mtime_ns for file in _inside(source)), default=0)
            for name, source in self.sources.items()
        }


def _inside(path: Path) -> Iterator[Path]:
    if path.is_file():
        yield path
    elif path.is_dir():
        files = (file for file in path.rglob("*") if file.is_file())
        yield from (file for file in files if not file.name.endswith(NOT_READ))


def read(path: Path) -> Record | None:
    """Read a record; None if there is none."""
    found = documents.read(path, Record)
    return None if found is None else Record.model_validate(found, strict=False)


def typed(arguments: Sequence[str]) -> str:
    """Return a command of the interpreter as a user types it."""
    return shlex.join(["python", *arguments])


@dataclass(frozen=True)
class Inputs:
    """The places of the files that parts are made of, and of those that they make."""

    output: Path  # folder of the page
    database: Path | None  # of the paper preset; that in the page's folder if None
    comparison: Path | None  # folder of `learn compare` and `learn tune`, likewise
    full: bool  # True for everything, False for what fits into ten minutes

    @property
    def files(self) -> dict[str, Path]:
        """The files that a part may read, by their names in commands."""
        return {
            "database": self.database or self.output / "databases" / "paper.h5",
            "comparison": self.comparison or self.output / "comparison",
        }

    def folder(self, part: Part) -> Path:
        """Return the folder of a part's files."""
        name = part.folder or part.name
        return self.files["comparison"] if name == "comparison" else self.output / name

    def template(self, part: Part) -> str:
        """Return the arguments of a part's command in this run, to be filled in."""
        return part.full if self.full else part.quick

    def arguments(self, part: Part) -> list[str]:
        """Return the arguments of the interpreter; none if the part is not in this run."""

        def wish(found: re.Match[str]) -> str:
            path = self.files[found[2]]
            there = path.is_file() or any(path.glob("**/*.csv"))
            return found[1] if there else ""

        given = re.sub(r"\[([^]]*\{(\w+)\})\]", wish, self.template(part))
        values = {"folder": self.folder(part), **self.files}
        return [word.format_map(values) for word in given.split()]

    def command(self, part: Part, command: str) -> str:
        """Return the command that made a part, with `report` for a folder that is not this one."""
        own = re.compile(rf"(.+)/{re.escape(part.folder or part.name)}(/.*)?")
        words = shlex.split(command)
        roots = {found[1] for word in words if (found := own.fullmatch(word))}
        for root in roots - {str(self.output)}:
            words = [re.sub(rf"^{re.escape(root)}(?=/)", "report", word) for word in words]
        return shlex.join(words)

    def making(self, part: Part) -> Making:
        """Return the record, command and inputs of a part, which decide whether it stays."""
        folder, named = self.folder(part), re.findall(r"\{(\w+)\}", self.template(part))
        sources = {name: path for name, path in self.files.items() if name in named}
        sources = {name: path for name, path in sources.items() if path != folder}
        return Making(folder / f"{part.name}.part.json", typed(self.arguments(part)), sources)
