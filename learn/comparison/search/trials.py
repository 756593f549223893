"""Finished fits on disk: no fit is done twice, whatever interrupts a search.

Each model and target has one file of lines (JSON). The master appends a line when a fit has come
back and hands it to the system; a line that a kill has cut short is dropped when the file is opened
again.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from gen.runtime import documents
from gen.runtime.errors import InputError
from learn.comparison import records

AT_BOUND = "close to the specified lower bound"
"""Words of scikit-learn's warning of a collapsed likelihood: older files have no other mark."""

DIVERGED = "prediction diverged"
"""The failure of a fit whose score is below `LEAST_SCORE`."""

LEAST_SCORE = -1e20
"""R2 below which a fit has diverged: a score like this would spoil means and tables."""


@dataclass(frozen=True)
class Trial:
    """The score of one candidate on one fold.

    Attributes
    ----------
    candidate : str
        Its canonical settings, as `learn.comparison.search.pruning.key` writes them.
    fold : int
        The fold that was left out of the training.
    rows : int
        Number of training rows; all of them, but for a search with a budget.
    r2 : float or None
        Coefficient of determination on the fold, None if the fit failed or diverged.
    failure : str
        The reason why there is no score.
    remark : str
        Warnings of the fit.
    collapsed : bool
        Whether the fit found nothing in its rows, so that its score says nothing about more rows;
        see `learn.comparison.search.fits.collapsed`.
    seconds : float
        Time of the fit and the scoring, shared evenly by the candidates of one fit [s].
    """

    candidate: str
    fold: int
    rows: int
    r2: float | None
    failure: str = ""
    remark: str = ""
    seconds: float = 0.0
    collapsed: bool = False

    @property
    def place(self) -> tuple[str, int, int]:
        """Candidate, fold and number of rows, which identify the trial."""
        return self.candidate, self.fold, self.rows


Finished = Mapping[tuple[str, int, int], Trial]
"""Finished trials by `Trial.place`."""


class Trials:
    """The finished trials of one model and target; a context manager that holds the file open.

    Parameters
    ----------
    path : Path
        The file, made with its folder if missing.
    conditions : dict
        Data, split, versions and seeds, which all trials have in common. A file of other conditions
        is refused.

    Attributes
    ----------
    finished : dict
        The trials by `Trial.place`.

    Raises
    ------
    InputError
        If the file holds other conditions or cannot be written.
    """

    def __init__(self, path: Path, conditions: dict[str, object]) -> None:
        self.path = path
        self.finished: dict[tuple[str, int, int], Trial] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{path.parent} cannot be made: {error.strerror}") from None
        self._file = self._opened(conditions)

    def __enter__(self) -> Self:
        """Return the open trials."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file."""
        self._file.close()

    def add(self, trials: list[Trial]) -> None:
        """Write the trials of one fit to the disk.

        Parameters
        ----------
        trials : list of Trial
            The trials.

        Raises
        ------
        InputError
            If the disk is full.
        """
        text = "".join(json.dumps(asdict(trial), allow_nan=False) + "\n" for trial in trials)
        try:
            self._file.write(text.encode())
            self._file.flush()
        except OSError as error:
            raise InputError(f"{self.path} cannot be written: {error.strerror}") from None
        self.finished.update((trial.place, trial) for trial in trials)

    def _opened(self, conditions: dict[str, object]) -> IO[bytes]:
        """Read the file, cut off a last line that is not whole, and open it for appending."""
        try:
            content = documents.read_bytes(self.path) if self.path.exists() else b""
            whole = content[: content.rfind(b"\n") + 1]
            self._read(whole, conditions)
            file = self.path.open("r+b" if content else "wb")
        except OSError as error:
            raise InputError(f"{self.path} cannot be written: {error.strerror}") from None
        file.truncate(len(whole))
        file.seek(len(whole))
        if not whole:
            file.write(json.dumps(conditions, sort_keys=True).encode() + b"\n")
        return file

    def _read(self, content: bytes, conditions: dict[str, object]) -> None:
        first, *lines = content.split(b"\n")[:-1] or [b""]
        if first:
            _compare(self.path, documents.checked(self.path, first, documents.Document), conditions)
        for number, line in enumerate(lines, start=2):
            read = documents.checked(f"{self.path}, line {number}", line, records.Trial)
            if "collapsed" not in read:
                read["collapsed"] = AT_BOUND in read.get("remark", "")
            if read["r2"] is not None and read["r2"] < LEAST_SCORE:  # in older files
                read |= {"r2": None, "failure": DIVERGED, "collapsed": False}
            trial = Trial(**read)
            self.finished[trial.place] = trial


def _compare(path: Path, stored: dict[str, object], wanted: dict[str, object]) -> None:
    """Refuse trials that were made under other conditions, naming the first that differs."""
    expected = json.loads(json.dumps(wanted))
    for name in sorted(expected.keys() | stored.keys()):
        if stored.get(name) != expected.get(name):
            raise InputError(
                f"{path} holds trials with {name} {stored.get(name)!r}, not {expected.get(name)!r}:"
                " give another folder, or the same options, data and versions"
            )
