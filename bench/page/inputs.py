"""The files and folders that the commands of parts are filled in with."""

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.page.parts import Part
from bench.page.record import Making


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
            "cost": self.output / "cost",
            "concentrated": self.output / "databases" / "concentrated.h5",
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
        given = re.sub(
            r"\[([^]]*\{(\w+)\})\]",
            lambda found: found[1] if _is_there(self.files[found[2]]) else "",
            self.template(part),
        )
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


def typed(arguments: Sequence[str]) -> str:
    """Return a command of the interpreter as a user types it."""
    return shlex.join(["python", *arguments])


def _is_there(path: Path) -> bool:
    """Say whether an input is there: a file, or a folder with a finished table."""
    return path.is_file() or any(path.glob("**/*.csv"))
