"""The files and folders that the commands of parts are filled in with."""

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.page.part import Part
from bench.page.record import Making

COMPARISON = "comparison"


@dataclass(frozen=True)
class Inputs:
    """The places of the files that parts are made of, and of those that they make.

    Attributes
    ----------
    output : Path
        Folder of the page.
    database : Path
        Database of the paper preset.
    comparison : Path
        Folder of `learn compare` and `learn tune`.
    full : bool
        True for everything, False for what fits into ten minutes.
    """

    output: Path
    database: Path
    comparison: Path
    full: bool

    def folder(self, part: Part) -> Path:
        """Return the folder of a part's files."""
        name = part.folder or part.name
        return self.comparison if name == COMPARISON else self.output / name

    def arguments(self, part: Part) -> list[str]:
        """Return the arguments of the interpreter; none if the part is not in this run."""
        files = self._files()
        given = re.sub(
            r"\[([^]]*\{(\w+)\})\]",
            lambda found: found[1] if _is_there(files[found[2]]) else "",
            self._template(part),
        )
        values = {"folder": self.folder(part), **files}
        return [word.format_map(values) for word in given.split()]

    def making(self, part: Part) -> Making:
        """Return what decides whether a part stays: its record, its command and its inputs."""
        folder, files = self.folder(part), self._files()
        named = re.findall(r"\{(\w+)\}", self._template(part))
        sources = {name: files[name] for name in named if files.get(name, folder) != folder}
        return Making(folder / f"{part.name}.part.json", typed(self.arguments(part)), sources)

    def _template(self, part: Part) -> str:
        return part.full if self.full else part.quick

    def _files(self) -> dict[str, Path]:
        return {
            "database": self.database,
            "comparison": self.comparison,
            "cost": self.output / "cost",
            "fine": self.output / "generalisation" / "databases" / "fine.h5",
        }


def typed(arguments: Sequence[str]) -> str:
    """Return a command of the interpreter as a user types it."""
    return shlex.join(["python", *arguments])


def _is_there(path: Path) -> bool:
    """Say whether an input is there: a file, or a folder with a finished table."""
    return path.is_file() or any(path.glob("**/*.csv"))
