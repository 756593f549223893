"""The time of a job's searches: shared among them, and remembered when the job is interrupted.

What a search has taken is written beside its trials when it ends or is interrupted. The same job
(command, budget, models and targets) goes on with what is left of its budget, and passes over the
searches that had ended. Once the last one has ended, these files are removed: the same command then
has a further budget. A kill leaves no time to write: the search under way has its share anew.
"""

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gen.runtime import documents, files
from learn.columns import short_name
from learn.comparison import records
from learn.comparison.search.budget import Share
from learn.request import Request

ENDING = ".clock.json"
"""End of the names of the files, whose beginning is that of the model."""


class Clock:
    """The time of a job, shared evenly among the searches that are left.

    Parameters
    ----------
    command : str
        Name of the job.
    request : Request
        Its folder, targets and time; without a time, every share is None and no file is written.
    models : iterable of str
        Names of the models that are searched for each target.
    """

    def __init__(self, command: str, request: Request, models: Iterable[str]) -> None:
        self._limit, self._folder = request.limit, request.output
        self._job: dict[str, Any] = {
            "command": command,
            "budget": request.limit,
            "models": list(models),
            "targets": [*map(short_name, request.targets)],
        }
        self._known: dict[Path, dict[str, Any]] = {}
        for target in self._job["targets"] if self._limit is not None else ():
            for model in models:
                path = self._path(target, model)
                self._known[path] = self._found(path) or {"spent": 0.0, "ended": False}

    def ended(self, target: str, model: str) -> bool:
        """Tell whether a search ended before the job was interrupted."""
        known = self._known.get(self._path(target, model))
        return known is not None and bool(known["ended"])

    @contextmanager
    def search(
        self, target: str, model: str, stopping: Callable[[], bool]
    ) -> Iterator[Share | None]:
        """Give a search its share of the time, and record the time that it takes.

        Parameters
        ----------
        target, model : str
            Names of the search's target and model.
        stopping : callable
            Asked at the end; True if the search was interrupted.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        if self._limit is None:
            yield None
            return
        known = self._known[self._path(target, model)]
        share, began = self._share(known["spent"]), time.monotonic()
        yield share
        known["spent"] = share.spent + time.monotonic() - began
        known["ended"] = not stopping()
        record = records.Clock.model_validate(self._job | known)
        files.write(self._path(target, model), record.model_dump_json(indent=1) + "\n")

    def close(self) -> None:
        """Remove the files of a job that has ended."""
        for path in self._known:
            path.unlink(missing_ok=True)

    def _share(self, spent: float) -> Share:
        assert self._limit is not None
        taken = sum(known["spent"] for known in self._known.values() if known["ended"])
        left = sum(not known["ended"] for known in self._known.values())
        return Share(max(self._limit - taken, 0.0) / left, spent)

    def _path(self, target: str, model: str) -> Path:
        return self._folder / target / "trials" / f"{model}{ENDING}"

    def _found(self, path: Path) -> dict[str, Any] | None:
        """Return the record of an interrupted run of this job; None without one."""
        found = documents.read(path, records.Clock)
        if found is None or any(found[name] != value for name, value in self._job.items()):
            return None
        return {name: found[name] for name in ("spent", "ended")}
