"""A comparison folder: the data and conditions of a comparison, and its results.

    area/comparison.json        conditions of all results: data, scene, options, seeds, versions
    area/rows.csv               sample (row of the database), part, fold, group kept together
    area/trials/MODEL.jsonl     finished fits of a search (`learn.comparison.fits`)
    area/baseline/MODEL.json    settings, scores, times; MODEL.csv has the test rows' predictions
    area/library/MODEL.json     the same with its library's settings, where a baseline's are others
    area/tuned/MODEL.json       the same for a search's winner, and how it was searched
    area/*.csv, *.png           the tables and pictures that `learn show` makes of them

Each target has a folder (here area). Files are written beside their place and then renamed. They
may have been edited, or come from strangers: each is checked whenever it is read.
"""

import csv
import io
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from gen.arrays import Values
from gen.runtime import documents, files
from gen.runtime.documents import Document, cell
from gen.runtime.errors import InputError
from learn.comparison import grid as grids
from learn.database_rows import Dataset
from learn.dataset import Request
from learn.models import EVERY, versions
from learn.split import FOLDS, Split

KINDS = (
    "baseline",
    "library",
    "tuned",
)  # kinds of results, and the names of their folders
# Origins of settings that `Folder.winner` gives, before the path of the folder. Cards of surrogates
# keep them, and `folder_of_origin` reads them there: later versions must not change them.
TUNED_IN = "tuned in "
BASELINE_BY = "the baseline, by "
LARGEST = 1e30  # bound of the targets' values: the axes of a picture take no larger ones

Count = Annotated[int, Field(ge=0, le=2**53)]
Seconds = Annotated[float, Field(ge=0, le=1e15)]
Score = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Setting = bool | int | float | str | list[int] | None
Scored = Annotated[
    dict[Literal["nmse", "nmae", "nmaxe", "r2"], Score], Field(min_length=4)
]
"""The four scores [%]; see `learn.metrics.Scores`."""


class Conditions(Document):
    """The conditions of results, as far as they are read; all of them are compared."""

    target: str
    features: str
    load: str = ""
    normalisation: str
    seed: Annotated[int, Field(ge=0, lt=2**32)]
    train_rows: Count
    test_rows: Count
    area_max: Annotated[float, Field(gt=0, le=100)] | None


class Comparison(Document):
    """The file comparison.json."""

    conditions: Conditions
    unit: str
    threads: Count


class Times(Document):
    """Times of a fit and of its predictions [s]; null (once NaN) where the fit has failed."""

    model_config = ConfigDict(allow_inf_nan=True)

    fit: float | None
    fits: Count
    test: float | None
    row: float | None
    search: Seconds


class Search(Document):
    """The description of a search in the result of its winner; R2 of folds in percent."""

    how: str
    grid: str = grids.TABLE_2
    rows: Count
    candidates: Count
    candidates_differing: Count
    candidates_scored: Count
    fits_nominal: Count
    fits: Count
    r2_folds: list[Score]
    winner: Literal["grid", "optimum", "baseline"] | None = None
    ends: list[str] = Field(default_factory=list)
    grid_r2_folds: list[Score] = Field(default_factory=list)
    optimum_r2_folds: list[Score] = Field(default_factory=list)
    baseline_r2_folds: list[Score] = Field(default_factory=list)
    failures: dict[str, Count]


class Result(Document):
    """The files KIND/MODEL.json; one of a search without a winner has model and failure only."""

    model: str
    settings: dict[str, Setting] = Field(default_factory=dict)
    fitted: dict[str, str] = Field(default_factory=dict)
    test: Scored | None = None
    train: Scored | None = None
    failure: str
    remarks: list[str]
    # Empty for a baseline.
    search: Search | Annotated[dict[str, object], Field(max_length=0)] = Field(
        default_factory=dict
    )
    times: Times | None = None

    @model_validator(mode="after")
    def _scores_have_times(self) -> "Result":
        times = (
            (self.times.fit, self.times.test, self.times.row) if self.times else (None,)
        )
        if self.test and any(each is None or not 0 <= each <= 1e15 for each in times):
            raise ValueError("there are scores without times of fit and predictions")
        return self


def require_same(
    path: Path, stored: Mapping[str, Any], wanted: Mapping[str, Any]
) -> None:
    """Refuse a file that was made under other conditions, naming the first that differs."""
    for name in sorted(wanted.keys() | stored.keys()):
        if stored.get(name) != wanted.get(name):
            raise InputError(
                f"{path} was made with {name} {stored.get(name)!r}, not {wanted.get(name)!r}: give"
                " another folder, or the same database, options and versions"
            )


class Settings(NamedTuple):
    """Settings of an estimator, and their origin."""

    values: dict[str, Any]  # those that differ from the model's baseline
    tuned: bool  # True if the baseline includes what all candidates of a search share
    origin: str  # in words


@dataclass(frozen=True)
class Folder:
    """One target's part of a comparison folder; InputError is raised if it is damaged."""

    path: Path

    def begin(self, dataset: Dataset, split: Split, request: Request) -> None:
        """Make the folder, or refuse it if it belongs to other data and choices.

        The conditions of results: two of them can be compared if these are equal.
        """
        pressed = dataset.features.by_pressure
        agreed = {
            "database_sha256": dataset.sha256,
            "target": dataset.target_name,
            "features": dataset.features.name,
            "inputs": list(dataset.features.columns),
            "normalisation": request.normalisation,
            "target_scaling": "standard" if dataset.features.scaled else "none",
            "seed": split.seed,
            "folds": FOLDS,
            "train_rows": int(split.train.size),
            "test_rows": int(split.test.size),
            "versions": versions(),
            "area_max": request.area_max,
            **({"load": "pressure"} if pressed else {}),
        }
        if (self.path / "comparison.json").exists():
            require_same(self.path, self.record()["conditions"], agreed)
            return
        # Rows that were split one by one are groups of their own.
        groups = dataset.groups if split.by_surface else np.arange(dataset.size)
        places = np.concatenate([split.train, split.test])
        parts = ["train"] * split.train.size + ["test"] * split.test.size
        folds = split.folds.tolist() + [""] * split.test.size
        columns = dataset.rows[places].tolist(), parts, folds, groups[places].tolist()
        self.write_table(
            "rows.csv", ("sample", "part", "fold", "group"), zip(*columns, strict=True)
        )
        self.write_json(
            "comparison.json",
            {
                "conditions": agreed,
                "database": dataset.name,
                "database_versions": json.loads(dataset.origins[0].versions),
                "scene": json.loads(dataset.origins[0].scene.text()),
                "usable_rows": dataset.size,
                "dropped_rows": dataset.dropped,
                "surfaces": int(np.unique(dataset.groups).size),
                "split_by_surface": split.by_surface,
                "split_by_tile": dataset.by_tile,
                "unit": dataset.unit,
                "threads": 1,
            },
        )

    def record(self) -> dict[str, Any]:
        """Read the folder's description: the conditions of its results."""
        record = documents.read(self.path / "comparison.json", Comparison)
        if record is None:
            raise InputError(
                f"{self.path} is no comparison: run learn compare or learn tune first"
            )
        return record

    def result(self, kind: str, model: str) -> dict[str, Any] | None:
        """Read the "baseline" or "tuned" result of a model, None if there is none."""
        return documents.read(self.path / kind / f"{model}.json", Result)

    def results(self) -> Iterator[tuple[str, str, dict[str, Any]]]:
        """Yield model, kind and result of each result, in the order of the paper's Table 4."""
        for model in EVERY:
            for kind in KINDS:
                result = self.result(kind, model)
                if result is not None:
                    yield model, kind, result

    def winner(self, model: str) -> Settings | None:
        """Read the winner of a model's search, None if the folder has none.

        Somebody may have edited the file, and with settings outside the grid, which are refused, a
        library may use up all memory or never end.
        """
        result = self.result("tuned", model)
        if result is None or "settings" not in result:
            return None
        settings = {  # JSON stores the layers of a perceptron as a list
            name: tuple(value) if isinstance(value, list) else value
            for name, value in result["settings"].items()
        }
        path = self.path / "tuned" / f"{model}.json"
        features = self.record()["conditions"]["features"]
        if result.get("search", {}).get("winner") == "baseline":
            if settings != grids.baseline(model, features):
                raise InputError(
                    f"{path}: settings = {settings!r} are not those of the baseline"
                )
            return Settings(settings, False, f"{BASELINE_BY}{self.path}")
        grid, space, _ = grids.space_of(model, features)
        for name, value in settings.items():
            if value not in grids.reach(name, space.get(name, [])):
                raise InputError(
                    f"{path}: {name} = {value!r} is not in the grid {grid!r}"
                )
        return Settings(settings, True, f"{TUNED_IN}{self.path}")

    def prediction(self, kind: str, model: str) -> tuple[Values, Values]:
        """Read truth and prediction of the test rows, each of shape (m,), in the target's unit."""
        truth, prediction = self.numbers(f"{kind}/{model}.csv", "truth", "prediction").T
        return truth, prediction

    def numbers(self, name: str, *columns: str, part: str = "") -> Values:
        """Read columns of a table, (rows, columns), or of the rows of one part of it."""
        path = self.path / name
        try:
            lines = csv.DictReader(files.read_bytes(path).decode().splitlines())
            rows = [row for row in lines if not part or row["part"] == part]
            table = np.array([[float(row[column]) for column in columns] for row in rows])
        except (FileNotFoundError, KeyError, ValueError, TypeError, csv.Error) as error:
            raise InputError(
                f"{path} cannot be read ({error}): learn compare DATABASE -o into a new folder"
                " makes it again"
            ) from None
        if not (np.abs(table) < LARGEST).all():
            raise InputError(f"{path}: holds values that are not finite: move it away")
        return table.reshape(-1, len(columns))

    def write_json(self, name: str, content: dict[str, Any]) -> Path:
        """Write a JSON file of the folder, and return its path."""
        return self._write(name, documents.json_text(content))

    def write_table(
        self, name: str, header: Sequence[str], rows: Iterable[Sequence[Any]]
    ) -> Path:
        """Write a table of the folder (CSV) with a header, and return its path."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerows([header, *(map(cell, row) for row in rows)])
        return self._write(name, text.getvalue())

    def _write(self, name: str, text: str) -> Path:
        path = files.inside(self.path, name)
        files.make_folder(path.parent)
        files.write(path, text)
        return path


def folder_of_origin(origin: str) -> Path | None:
    """Return the folder that settings come from.

    Parameters
    ----------
    origin : str
        Origin of settings, from `Folder.winner` or from anywhere else.

    Returns
    -------
    Path or None
        Folder of the target in its comparison; None if no comparison chose the settings.
    """
    for words in (TUNED_IN, BASELINE_BY):
        if origin.startswith(words):
            return Path(origin.removeprefix(words))
    return None


def targets(path: Path) -> list[Folder]:
    """List the targets of a comparison folder; InputError is raised if it has none."""
    names = sorted(record.parent.name for record in path.glob("*/comparison.json"))
    folders = [Folder(files.inside(path, name)) for name in names]
    if not folders:
        raise InputError(
            f"{path} holds no comparison: run learn compare or learn tune first"
        )
    return folders
