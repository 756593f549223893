"""The search: damage a sound file, run a command on it, and keep what should not have happened."""

import re
import shutil
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np

from gen.runtime.errors import InputError
from tests.fuzz import child, corpus
from tests.fuzz.corpus import KINDS, Kind
from tests.fuzz.mutation import damaged


@dataclass(frozen=True)
class Case:
    """One damaged file and the command that was run on it.

    Attributes
    ----------
    number : of the case; with the seed, the whole case follows from it
    kind : one of `KINDS`
    victim : the damaged file, in the case's folder
    command : the command line
    ended : how it ended
    fault : what is wrong with that, "" if nothing is
    """

    number: int
    kind: str
    victim: str
    command: tuple[str, ...]
    ended: child.Ended
    fault: str

    @property
    def signature(self) -> str:
        """What the finding is, without the numbers and names that differ from case to case."""
        what = re.sub(r"'[^']*'|\d+", "_", self.fault)
        return f"{' '.join(self.command[:2])}: {what}"


def fuzz(
    folder: Path,
    *,
    seed: int = 0,
    kinds: Sequence[str] = tuple(KINDS),
    seconds: float = float("inf"),
    first: int = 0,
    last: int | None = None,
) -> Iterator[Case]:
    """Run damaged cases, one after the other.

    Parameters
    ----------
    folder : an empty folder to work in; after each case, `folder/case` is as the command left it
    seed : of everything
    kinds : what to damage
    seconds : no case begins later
    first, last : numbers of the first case, and one past the last, None for no end

    Yields
    ------
    All cases, those that ended as they should among them

    Raises
    ------
    InputError
        For an unknown kind, or if sound files cannot be made.
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


def _tried(sound: Path, folder: Path, number: int, seed: int, kinds: Sequence[str]) -> Case:
    """Damage one file in a fresh folder, and run one command on it."""
    random = np.random.default_rng([seed, number])
    name = str(random.choice(list(kinds)))
    kind = KINDS[name]
    victims = sorted(path for pattern in kind.victims for path in sound.glob(pattern))
    victim = victims[int(random.integers(len(victims)))].relative_to(sound)
    content = damaged((sound / victim).read_bytes(), victim.name, random)
    command = _chosen(kind, content, random)
    _lay_out(sound, folder, kind, victim)
    (folder / victim).write_bytes(content)
    words = tuple(str(victim) if word == "VICTIM" else word for word in command)
    ended = child.run(words, folder)
    return Case(number, name, str(victim), words, ended, child.fault(words, ended))


def _chosen(kind: Kind, content: bytes, random: np.random.Generator) -> tuple[str, ...]:
    """One of the commands that may be run on some content."""
    chosen = kind.commands[int(random.integers(len(kind.commands)))]
    return chosen if kind.tame(content) else kind.commands[0]


def _lay_out(sound: Path, folder: Path, kind: Kind, victim: Path) -> None:
    """Copy what a command needs."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for name in {*kind.beside, str(victim)}:
        source = sound / name
        if source.is_dir():
            shutil.copytree(source, folder / name, dirs_exist_ok=True)
        else:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, folder / name)
