"""Finished fits on disk: no fit is done twice, whatever interrupts a search.

Each model and target has one file of lines (JSON). The master appends a line when a fit has come
back and hands it to the system; a line that a kill has cut short is dropped when the file is opened
again.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import IO, Annotated, Self

from pydantic import ConfigDict, Field

from gen.runtime import documents, files
from gen.runtime.errors import InputError
from learn.comparison.records import Count, Seconds
from learn.split import FOLDS

LEAST_SCORE = -1e20
"""R2 below which a fit has diverged: a score like this would spoil means and tables."""


class Trial(documents.Document):
    """The score of one candidate on one fold, a line of the file.

    Attributes
    ----------
    candidate : str
        Its canonical settings, as `learn.comparison.grid.key` writes them.
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
    seconds : float
        Time of the fit and the scoring, shared evenly by the candidates of one fit [s].
    collapsed : bool
        Whether the fit found nothing in its rows, so that its score says nothing about more rows;
        see `learn.comparison.fits.collapsed`.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    candidate: str
    fold: Annotated[int, Field(ge=0, lt=FOLDS)]
    rows: Count
    r2: Annotated[float, Field(ge=LEAST_SCORE, le=1)] | None
    failure: str = ""
    remark: str = ""
    seconds: Seconds = 0.0
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
        files.make_folder(path.parent)
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

        Raises
        ------
        InputError
            If the disk is full.
        """
        lines = [json.dumps(trial.model_dump(), allow_nan=False) for trial in trials]
        try:
            self._file.write("".join(f"{line}\n" for line in lines).encode())
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
        """Take the trials of a file, and refuse those that were made under other conditions."""
        first, *lines = content.split(b"\n")[:-1] or [b""]
        if not first:
            return
        stored = documents.checked(self.path, first, documents.Document)
        wanted = json.loads(json.dumps(conditions))
        for name in sorted(wanted.keys() | stored.keys()):
            if stored.get(name) != wanted.get(name):
                raise InputError(
                    f"{self.path} holds trials with {name} {stored.get(name)!r}, not"
                    f" {wanted.get(name)!r}: give another folder, or the same options, data and"
                    " versions"
                )
        for number, line in enumerate(lines, start=2):
            read = documents.checked(f"{self.path}, line {number}", line, Trial)
            trial = Trial(**read)
            self.finished[trial.place] = trial
