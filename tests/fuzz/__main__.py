"""`python -m tests.fuzz`: commands on damaged files, for as many minutes as there are."""

import re
import shlex
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from gen.runtime import command_line, farm
from gen.runtime.errors import InputError
from gen.scene import Scene
from tests.fuzz import child, corpus
from tests.fuzz.corpus import KINDS, damaged


@dataclass(frozen=True)
class Case:
    """One damaged file and the command that was run on it; all follows from seed and number."""

    number: int
    kind: str
    command: tuple[str, ...]
    ended: child.Ended
    fault: str

    @property
    def signature(self) -> str:
        """What the finding is, without the numbers and names that differ from case to case."""
        what = re.sub(r"'[^']*'|\d+", "_", self.fault)
        return f"{' '.join(self.command[:2])}: {what}"

    def kept(self, worked: Path, folder: Path) -> str:
        """Keep the folder in which it worked, with all that it needs to fail again; tell of it."""
        shutil.copytree(worked, folder, symlinks=True)
        command = shlex.join(["python", "-m", *self.command])
        (folder / "command.txt").write_text(f"{command}\n", encoding="utf-8")
        said = f"{self.fault}\n{self.ended.errors}{self.ended.output}"
        (folder / "said.txt").write_text(said, encoding="utf-8")
        return f"case {self.number}: {command}: {self.fault}: {folder}"


def cases(
    folder: Path,
    seed: int = 0,
    kinds: Sequence[str] = tuple(KINDS),
    *,
    seconds: float = float("inf"),
    first: int = 0,
    last: int | None = None,
) -> Iterator[Case]:
    """Run damaged cases one after the other, each on files in the empty folder's `case`.

    Cases `first` to `last` (None: no end), none of which begins after so many seconds.
    """
    if unknown := set(kinds) - set(KINDS):
        raise InputError(f"no kind {sorted(unknown)[0]!r}; there are {', '.join(KINDS)}")
    for program in {command[0] for kind in kinds for command in KINDS[kind].commands}:
        child.load(program)
    sound = folder / "sound"
    sound.mkdir()
    corpus.make(sound, tuple(kinds))
    limit = time.monotonic() + seconds
    for number in count(first):
        if number == last or time.monotonic() > limit:
            return
        yield _tried(sound, folder / "case", number, seed, kinds)


def _tried(
    sound: Path, folder: Path, number: int, seed: int, kinds: Sequence[str]
) -> Case:
    """Damage one file in a fresh folder, and run one command on it."""
    random = np.random.default_rng([seed, number])
    name = str(random.choice(list(kinds)))
    kind = KINDS[name]
    victims = sorted(path for pattern in kind.victims for path in sound.glob(pattern))
    victim = victims[int(random.integers(len(victims)))].relative_to(sound)
    content = damaged((sound / victim).read_bytes(), victim.name, random)
    command = kind.commands[int(random.integers(len(kind.commands)))]
    if name == "scene" and not _is_small(content):
        command = kind.commands[0]
    shutil.rmtree(folder, ignore_errors=True)
    for name in {*kind.beside, str(victim)}:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if (sound / name).is_dir():
            shutil.copytree(sound / name, folder / name, dirs_exist_ok=True)
        else:
            shutil.copyfile(sound / name, folder / name)
    (folder / victim).write_bytes(content)
    words = tuple(str(victim) if word == "VICTIM" else word for word in command)
    ended = child.run(words, folder)
    return Case(number, name, words, ended, child.fault(words, ended))


def _is_small(content: bytes) -> bool:
    """Whether a scene, if it is one, is no more than seconds of work."""
    try:
        scene = Scene.parse(content.decode(), "scene")
    except (InputError, UnicodeDecodeError):
        return True
    return scene.samples <= 500 and scene.shape[0] <= 65


app = typer.Typer(add_completion=False, rich_markup_mode=None)


@app.command()
def fuzz(
    minutes: Annotated[float, typer.Option(min=0.0, help="No case begins later.")] = 10.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all damage.")] = 0,
    number: Annotated[
        int | None,
        typer.Option(
            "--cases", min=1, help="Number of cases at most; no bound unless given."
        ),
    ] = None,
    first: Annotated[int, typer.Option(min=0, help="Number of the first case.")] = 0,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="KIND", help=f"{', '.join(KINDS)}, alone."),
    ] = None,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="DIR", help="Where findings are written."),
    ] = Path("fuzz-findings"),
) -> int:
    """Damage files at random, run commands on them, and see that none crashes, hangs or babbles.

    Right are success, or exit code 2 with one clear line (of `gen check`, 1 too). What else happens
    is kept with its command, DIR/NNN-KIND, and makes the exit code 1. The same seed and number of a
    case do the same damage.
    """
    if output.exists():
        raise InputError(f"{output} exists: give a new folder")
    kinds, last = only or tuple(KINDS), None if number is None else first + number
    found: Counter[str] = Counter()
    done, began = 0, time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        seconds = 60.0 * minutes
        for case in cases(
            Path(folder), seed, kinds, seconds=seconds, first=first, last=last
        ):
            done += 1
            if case.fault:
                found[case.signature] += 1
                if found[case.signature] == 1:
                    line = case.kept(
                        Path(folder) / "case", output / f"{len(found):03}-{case.kind}"
                    )
                    typer.echo(line, err=True)
    taken = time.monotonic() - began
    typer.echo(
        f"{done} cases in {taken:.0f} s; {found.total()} findings of {len(found)} kinds"
    )
    return 1 if found else 0


if __name__ == "__main__":
    with farm.process():
        code = command_line.main(app, sys.argv[1:], "fuzz", single_process=True)
    sys.exit(code)
