"""A comparison folder: the data and conditions of a comparison, and its results.

    area/comparison.json        conditions of all results: data, scene, options, seeds, versions
    area/rows.csv               sample (row of the database), part, fold, group kept together
    area/trials/MODEL.jsonl     finished fits of a search (`learn.comparison.fits`)
    area/baseline/MODEL.json    settings, scores, times; MODEL.csv has the test rows' predictions
    area/library/MODEL.json     the same with its library's settings, where a baseline's are others
    area/tuned/MODEL.json       the same for a search's winner, and how it was searched
    area/*.csv, *.png           the tables and pictures that `learn show` makes of them

Each target has a folder (here area). A file is written under another name and then renamed.
Somebody may have edited a file, or received it from a stranger: every file is checked whenever it
is read, and what is read is the checked document.

`learn.comparison.tables` and `bench.paper.models` make our Tables 2 to 4 from these files.
"""

import csv
import io
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import ConfigDict, Field, field_validator, model_validator

from gen.arrays import Values
from gen.runtime import documents, files
from gen.runtime.documents import Document, cell
from gen.runtime.errors import InputError
from learn.comparison import grid as grids
from learn.database_rows import Dataset
from learn.dataset import Request
from learn.models import EVERY, versions
from learn.split import FOLDS, Split

KINDS = ("baseline", "library", "tuned")
"""Kinds of results, and the names of their folders."""

LARGEST = 1e30
"""Bound of the targets' values: the axes of a picture take no larger ones."""

LONGEST = 1e15
"""Bound of the times in results [s]."""

# Origins of settings that `Folder.winner` gives, before the path of the folder. Cards of surrogates
# keep them, and `folder_of_origin` reads them there: later versions must not change them.
TUNED_IN = "tuned in "
BASELINE_BY = "the baseline, by "

Count = Annotated[int, Field(ge=0, le=2**53)]
Seconds = Annotated[float, Field(ge=0, le=LONGEST)]
Score = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Setting = bool | int | float | str | list[int] | None


class StoredScores(Document):
    """The four scores of a result [%]; see `learn.metrics.Scores`."""

    nmse: Score
    nmae: Score
    nmaxe: Score
    r2: Score


class Conditions(Document):
    """The conditions of results: two results can be compared if all conditions are equal.

    A file has further conditions, which are compared but not read.
    """

    target: str  # column of the database
    features: str
    inputs: list[str] = Field(default_factory=list)  # names of the features
    load: str = ""
    normalisation: str
    seed: Annotated[int, Field(ge=0, lt=2**32)]
    train_rows: Count
    test_rows: Count
    area_max: Annotated[float, Field(gt=0, le=100)] | None  # [%]


class Comparison(Document):
    """The file comparison.json, which describes the data of a comparison."""

    conditions: Conditions
    database: str = ""  # name of its file
    split_by_surface: bool = True  # False if the rows were split one by one
    split_by_tile: bool = False
    unit: str  # of the target
    threads: Count


class Times(Document):
    """Times of a fit and of its predictions [s]; null (once NaN) where the fit has failed."""

    model_config = ConfigDict(allow_inf_nan=True)

    fit: float | None  # median of the fits to all training rows
    fits: Count
    test: float | None  # of predicting the whole test set
    row: float | None  # of predicting one row
    search: Seconds  # of all fits of the search


class SearchReport(Document):
    """How the winner of a result was searched; R2 of folds in percent."""

    how: str  # steps of the search in words
    grid: str = grids.TABLE_2  # name of the grid
    rows: Count  # that all deciding fits were trained and scored on
    candidates: Count
    candidates_differing: Count
    candidates_scored: Count  # on all folds of all rows
    fits_nominal: Count  # without fits that serve several candidates
    fits: Count  # that were done
    baseline_fits: Count = 0  # fits of the baseline that have a score
    winner: Literal["grid", "optimum", "baseline"] | None = None
    ends: list[str] = Field(default_factory=list)
    """Settings with which the best candidate lies at an end of all values that were tried."""
    r2_folds: list[Score]  # of the winner
    grid_r2_folds: list[Score] = Field(default_factory=list)  # of the best candidate
    optimum_r2_folds: list[Score] = Field(default_factory=list)  # of the paper's optimum
    baseline_r2_folds: list[Score] = Field(default_factory=list)
    failures: dict[str, Count]  # numbers of scores that a failure has cost, by its reason
    remarks: dict[str, Count] = Field(default_factory=dict)
    """Numbers of scores that a warning concerns, by its text."""


class Result(Document):
    """The files KIND/MODEL.json; one of a search without a winner has model and failure only."""

    model: str
    settings: dict[str, Setting] = Field(default_factory=dict)  # on top of the baseline's
    fitted: dict[str, str] = Field(default_factory=dict)  # what the fit has chosen itself
    test: StoredScores | None = None
    train: StoredScores | None = None
    failure: str  # "" if the fit has scores
    remarks: list[str]
    search: SearchReport | None = None  # None for a result that nothing was searched for
    times: Times | None = None

    @field_validator("search", mode="before")
    @classmethod
    def _no_search(cls, search: object) -> object:
        """Return None for the empty object that the file of a baseline has."""
        return None if search == {} else search

    @model_validator(mode="after")
    def _scores_have_times(self) -> "Result":
        """Refuse scores without the times of fit and predictions."""
        if self.test and not _are_complete(self.times):
            raise ValueError("there are scores without times of fit and predictions")
        return self

    @property
    def has_winner(self) -> bool:
        """Whether the result has settings; a search without a winner has none."""
        return "settings" in self.model_fields_set


def _are_complete(times: Times | None) -> bool:
    """Return whether all times of a fit are known, and none is negative or far too long."""
    if times is None:
        return False
    for seconds in (times.fit, times.test, times.row):
        if seconds is None or not 0 <= seconds <= LONGEST:
            return False
    return True


@dataclass(frozen=True)
class StoredResult:
    """A result of a folder, with its place."""

    model: str
    kind: str  # one of `KINDS`
    result: Result


@dataclass(frozen=True)
class Settings:
    """Settings of an estimator, and their origin."""

    values: dict[str, Any]  # those that differ from the model's baseline
    tuned: bool  # True if the baseline includes what all candidates of a search share
    origin: str  # in words


class Predictions(NamedTuple):
    """Test rows of a result, in the target's unit."""

    truth: Values  # shape (m,)
    prediction: Values  # shape (m,)


def require_same(
    path: Path, stored: Mapping[str, Any], wanted: Mapping[str, Any]
) -> None:
    """Refuse a file that was made under other conditions.

    Parameters
    ----------
    path : Path
        The file, for the message.
    stored, wanted : mapping
        Conditions of the file and of this run, by their names.

    Raises
    ------
    InputError
        If any condition differs; the message names the first one in alphabetical order.
    """
    for name in sorted(wanted.keys() | stored.keys()):
        if stored.get(name) != wanted.get(name):
            raise InputError(
                f"{path} was made with {name} {stored.get(name)!r}, not {wanted.get(name)!r}: give"
                " another folder, or the same database, options and versions"
            )


def conditions_of(dataset: Dataset, split: Split, request: Request) -> dict[str, Any]:
    """Return the conditions of results, as comparison.json has them.

    Parameters
    ----------
    dataset : Dataset
        Rows of one target.
    split : Split
        Training and test rows among them.
    request : Request
        Choices of the user.

    Returns
    -------
    dict
        Conditions by name, of types that JSON has; those of `Conditions` are among them.
    """
    features = dataset.features
    conditions = {
        "database_sha256": dataset.sha256,
        "target": dataset.target_name,
        "features": features.name,
        "inputs": list(features.columns),
        "normalisation": request.normalisation,
        "target_scaling": "standard" if features.scaled else "none",
        "seed": split.seed,
        "folds": FOLDS,
        "train_rows": int(split.train.size),
        "test_rows": int(split.test.size),
        "versions": versions(),
        "area_max": request.area_max,
    }
    # Results of before other loads were possible are compared too: "delta" is not written.
    if features.by_pressure:
        conditions["load"] = "pressure"
    return conditions


@dataclass(frozen=True)
class Folder:
    """One target's part of a comparison folder.

    Every method that reads raises InputError if a file is damaged, and every method that writes
    raises it if the file cannot be written.
    """

    path: Path

    def begin(self, dataset: Dataset, split: Split, request: Request) -> None:
        """Write rows.csv and comparison.json, or compare the conditions of an earlier one.

        Parameters
        ----------
        dataset : Dataset
            Rows of this target.
        split : Split
            Training and test rows among them.
        request : Request
            Choices of the user.

        Raises
        ------
        InputError
            If the folder holds results of other conditions.
        """
        conditions = conditions_of(dataset, split, request)
        if (self.path / "comparison.json").exists():
            require_same(self.path, self.record().conditions.content(), conditions)
            return
        self._write_rows(dataset, split)
        origin = dataset.origins[0]
        description = {
            "conditions": conditions,
            "database": dataset.name,
            "database_versions": json.loads(origin.versions),
            "scene": json.loads(origin.scene.text()),
            "usable_rows": dataset.size,
            "dropped_rows": dataset.dropped,
            "surfaces": int(np.unique(dataset.groups).size),
            "split_by_surface": split.by_surface,
            "split_by_tile": dataset.by_tile,
            "unit": dataset.unit,
            "threads": 1,
        }
        self.write_json("comparison.json", description)

    def _write_rows(self, dataset: Dataset, split: Split) -> None:
        """Write rows.csv: the training rows with their folds, then the test rows."""
        samples = dataset.rows.tolist()
        # Rows that were split one by one are groups of their own.
        groups = dataset.groups if split.by_surface else np.arange(dataset.size)
        train = [
            (samples[row], "train", fold, int(groups[row]))
            for row, fold in zip(split.train, split.folds.tolist(), strict=True)
        ]
        test = [(samples[row], "test", "", int(groups[row])) for row in split.test]
        header = ("sample", "part", "fold", "group")
        self.write_table("rows.csv", header, [*train, *test])

    def record(self) -> Comparison:
        """Read comparison.json.

        Returns
        -------
        Comparison
            Description of the data, with the conditions of all results.

        Raises
        ------
        InputError
            If the folder has no comparison, or the file is damaged.
        """
        record = documents.read(self.path / "comparison.json", Comparison)
        if record is None:
            raise InputError(
                f"{self.path} is no comparison: run learn compare or learn tune first"
            )
        return record

    def result(self, kind: str, model: str) -> Result | None:
        """Read the result of a model.

        Parameters
        ----------
        kind : str
            One of `KINDS`.
        model : str
            Name of the model.

        Returns
        -------
        Result or None
            The result, or None if the folder has none.
        """
        return documents.read(self.path / kind / f"{model}.json", Result)

    def results(self) -> Iterator[StoredResult]:
        """Yield all results, in the order of the paper's Table 4 and of `KINDS`."""
        for model in EVERY:
            for kind in KINDS:
                result = self.result(kind, model)
                if result is not None:
                    yield StoredResult(model, kind, result)

    def winner(self, model: str) -> Settings | None:
        """Read the settings of the winner of a model's search.

        Somebody may have edited the file: with settings outside the grid a library may use up all
        memory, or never end. They are refused.

        Parameters
        ----------
        model : str
            Name of the model.

        Returns
        -------
        Settings or None
            The winner, which may be the baseline; None if the folder has no winner.

        Raises
        ------
        InputError
            If the file is damaged, or a setting lies outside the grid.
        """
        result = self.result("tuned", model)
        if result is None or not result.has_winner:
            return None
        settings = {name: _as_searched(value) for name, value in result.settings.items()}
        path = self.path / "tuned" / f"{model}.json"
        features = self.record().conditions.features
        if result.search is not None and result.search.winner == "baseline":
            if settings != grids.baseline(model, features):
                raise InputError(
                    f"{path}: settings = {settings!r} are not those of the baseline"
                )
            return Settings(settings, False, f"{BASELINE_BY}{self.path}")
        space = grids.space_of(model, features)
        for name, value in settings.items():
            if value not in grids.reach(name, space.values.get(name, [])):
                raise InputError(
                    f"{path}: {name} = {value!r} is not in the grid {space.name!r}"
                )
        return Settings(settings, True, f"{TUNED_IN}{self.path}")

    def prediction(self, kind: str, model: str) -> Predictions:
        """Read the predictions of a result.

        Parameters
        ----------
        kind : str
            One of `KINDS`.
        model : str
            Name of the model.

        Returns
        -------
        Predictions
            Truth and prediction of the test rows, each of shape (m,), in the target's unit.

        Raises
        ------
        InputError
            If the table is missing or damaged.
        """
        truth, prediction = self.numbers(f"{kind}/{model}.csv", "truth", "prediction").T
        return Predictions(truth, prediction)

    def numbers(self, name: str, *columns: str, part: str = "") -> Values:
        """Read columns of numbers of a table.

        Parameters
        ----------
        name : str
            File name within the folder.
        *columns : str
            Names of the columns.
        part : str
            "train" or "test" for rows of this part only, in a table with a column `part`; "" for
            all rows.

        Returns
        -------
        ndarray, shape (rows, columns)
            The numbers.

        Raises
        ------
        InputError
            If the table is missing or damaged, or a number is not finite or too large.
        """
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
        """Write a JSON file of the folder.

        Parameters
        ----------
        name : str
            File name within the folder.
        content : dict
            Keys and values; all numbers are finite.

        Returns
        -------
        Path
            The file.
        """
        return self._write(name, documents.json_text(content))

    def write_table(
        self, name: str, header: Sequence[str], rows: Iterable[Sequence[Any]]
    ) -> Path:
        """Write a CSV table of the folder.

        Parameters
        ----------
        name : str
            File name within the folder.
        header : sequence of str
            Names of the columns.
        rows : iterable of sequence
            Cells of each row, in the order of the header.

        Returns
        -------
        Path
            The file.
        """
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(header)
        for row in rows:
            writer.writerow([cell(value) for value in row])
        return self._write(name, text.getvalue())

    def _write(self, name: str, text: str) -> Path:
        """Write a file of the folder, with the folders above it, and return its path."""
        path = files.inside(self.path, name)
        files.make_folder(path.parent)
        files.write(path, text)
        return path


def _as_searched(value: Setting) -> Any:
    """Return a setting as a grid has it: JSON stores the layers of a perceptron as a list."""
    return tuple(value) if isinstance(value, list) else value


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
    """List the targets of a comparison folder.

    Parameters
    ----------
    path : Path
        The comparison folder.

    Returns
    -------
    list of Folder
        One target or more, in alphabetical order.

    Raises
    ------
    InputError
        If the folder holds no comparison.
    """
    names = sorted(record.parent.name for record in path.glob("*/comparison.json"))
    folders = [Folder(files.inside(path, name)) for name in names]
    if not folders:
        raise InputError(
            f"{path} holds no comparison: run learn compare or learn tune first"
        )
    return folders
