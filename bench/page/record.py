"""How something was made: written beside its files, and compared before it is made again."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from bench.circumstances import circumstances
from bench.files import is_there
from bench.page.content import Content, Figure, Table, files_of, moved
from gen.runtime import documents, files

SAME = ("state", "versions", "machine")  # what has to be as it was for something to stay
# Ends of the names of files that record how a part was made; no part reads them.
NOT_READ = (".part.json", ".printed.txt")


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
    contents: list[Content] = Field(default_factory=list)
    inputs: dict[str, int]
    created: str
    commit: str
    state: str = ""  # of the code; empty in records of before it was written down
    machine: Machine
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

    def stays(self) -> bool:
        """Say whether the record is of the same command, inputs, code, packages and machine."""
        found = read(self.path)
        if found is None or not found.finished:
            return False
        then = found.model_dump()
        now = circumstances() | {"command": self.command, "inputs": self._stamps()}
        return all(then[name] == now[name] for name in ("command", "inputs", *SAME))

    def write(self, contents: Sequence[Content] = (), **said: Any) -> None:
        """Write the record, with the contents that are shown if it is to say so.

        Their files are in the record's folder; `said` are further fields of `Record`.
        """
        folder = self.path.parent
        if contents:
            said["contents"] = [moved(e, lambda file: file.relative_to(folder)) for e in contents]
        known = {"command": self.command, "inputs": self._stamps(), **circumstances()}
        record = Record(**known, **said)
        files.write(self.path, record.model_dump_json(indent=2, exclude_unset=True) + "\n")

    def _stamps(self) -> dict[str, int]:
        """Return when each input was changed last [ns]; 0 for a missing one."""
        return {
            name: max((file.stat().st_mtime_ns for file in _inside(source)), default=0)
            for name, source in self.sources.items()
        }


def read(path: Path) -> Record | None:
    """Read a record; None if there is none."""
    found = documents.read(path, Record)
    return None if found is None else Record.model_validate(found, strict=False)


def contents_of(path: Path) -> list[Content] | None:
    """Return the contents that a record lists; None without a record, or if a file is missing."""
    found = read(path)
    if found is None:
        return None
    contents = [moved(each, lambda file: path.parent / file) for each in found.contents]
    whole = all(is_there(file) for each in contents for file in files_of(each))
    if not whole:
        return None
    return [
        replace(each, command=each.command or found.command)
        if isinstance(each, Figure | Table)
        else each
        for each in contents
    ]


def _inside(path: Path) -> Iterator[Path]:
    if path.is_file():
        yield path
    elif path.is_dir():
        files = (file for file in path.rglob("*") if file.is_file())
        yield from (file for file in files if not file.name.endswith(NOT_READ))
