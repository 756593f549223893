"""Where the files of a run are, and how each part was made: on which machine, of which code.

Records are compared before a part is made again.
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
    *(
        "asperity",
        "numpy",
        "scipy",
        "pyfftw",
        "h5py",
        "mpi4py",
        "scikit-learn",
        "xgboost",
    ),
    *("xgboost-cpu", "ContactMechanics", "tamaas", "aspher"),
)
"""Packages whose versions are written down where they are installed."""

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("asperity", "bem", "bench", "gen", "learn")
RESULTS = ROOT / "bench" / "results"
CODE = {".py", ".toml", ".jinja", ".html"}  # ends of the names of files that are code


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


def code_state(root: Path = ROOT) -> str:
    """Return a hash of all programs, settings and templates of the packages under a folder.

    Documents and results do not change it; it needs no git, and sees what is not committed.
    """
    digest = hashlib.sha256()
    files = (path for name in SOURCES for path in (root / name).rglob("*"))
    results = root / RESULTS.relative_to(ROOT)
    code = (
        path for path in files if path.suffix in CODE and not path.is_relative_to(results)
    )
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
RECORD = ".part.json"
NOT_READ = (RECORD, ".printed.txt", ".said.txt")
PAGE = "index.html"


class Machine(documents.Document):
    """The machine on which something was made."""

    processor: str


class Record(documents.Document):
    """How something was made, and how it ended; a record lies in the folder of what was made."""

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


def _inside(path: Path) -> Iterator[Path]:
    if path.is_file():
        yield path
    elif path.is_dir():
        files = (file for file in path.rglob("*") if file.is_file())
        yield from (file for file in files if not file.name.endswith(NOT_READ))


def read(path: Path) -> Record | None:
    """Read a record; None if there is none."""
    found = documents.read(path, Record)
    return None if found is None else Record.model_validate(found.content(), strict=False)


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
            words = [
                re.sub(rf"^{re.escape(root)}(?=/)", "report", word) for word in words
            ]
        return shlex.join(words)

    def path(self, part: Part) -> Path:
        """Return the file of a part's record."""
        return self.folder(part) / f"{part.name}{RECORD}"

    def typed(self, part: Part) -> str:
        """Return a part's command as a user types it."""
        return shlex.join(["python", *self.arguments(part)])

    def sources(self, part: Part) -> dict[str, Path]:
        """Return the files and folders that a part's command reads, by name."""
        named = re.findall(r"\{(\w+)\}", self.template(part))
        found = {name: path for name, path in self.files.items() if name in named}
        return {name: path for name, path in found.items() if path != self.folder(part)}

    def stale(self, part: Part) -> str:
        """Say why a part has to be made, "" if it stays: what has changed since its record."""
        found = read(self.path(part))
        if found is None or not found.finished:
            return "new" if found is None else "not finished"
        then, now = found.model_dump(), self._made_of(part)
        changed = [said for name, said in SAME.items() if then[name] != now[name]]
        return f"other {', '.join(changed)}" if changed else ""

    def write(self, part: Part, **said: Any) -> None:
        """Write a part's record; `said` are the fields of `Record` that are not known here."""
        record = Record(**self._made_of(part), **said)
        write(
            self.path(part), record.model_dump_json(indent=2, exclude_unset=True) + "\n"
        )

    def _made_of(self, part: Part) -> dict[str, Any]:
        """Return command, circumstances, and when each input was changed last [ns]."""
        stamps = {
            name: max((file.stat().st_mtime_ns for file in _inside(source)), default=0)
            for name, source in self.sources(part).items()
        }
        return {"command": self.typed(part), "inputs": stamps, **circumstances()}
