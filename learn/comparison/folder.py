"""A comparison folder: the data and conditions of a comparison, and its results.

    area/comparison.json        conditions of all results: data, scene, options, seeds, versions
    area/rows.csv               sample (row of the database), part, fold and group of each row
    area/trials/MODEL.jsonl     finished fits of a search (`learn.comparison.fits`)
    area/baseline/MODEL.json    settings, scores and times of a baseline
    area/baseline/MODEL.csv     predictions of the test rows
    area/library/MODEL.*        a model with its library's settings, if the baseline has others
    area/tuned/MODEL.*          the winner of a search, and a report of the search
    area/*.csv, *.png           tables and pictures that `learn show` makes of the results

Each target has a folder of its own (here area). A file is written under another name and then
renamed, so that no reader meets half of it. Somebody may have edited a file, or received it from a
stranger: every file is checked against the classes below whenever it is read.

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
"""Largest magnitude of scores and of numbers in tables, which axes of pictures still allow."""

LONGEST = 1e15
"""Largest time in a result [s]."""

# Types of values in the files, with their ranges.
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

    A file has more conditions than these fields (`conditions_of`), which are compared but not used.
    """

    target: str  # column of the database
    features: str  # name of the feature set
    inputs: list[str] = Field(default_factory=list)  # names of the features
    load: str = ""  # "pressure", or "" for Delta
    normalisation: str  # scaling of the features; see `learn.models.pipeline`
    seed: Annotated[int, Field(ge=0, lt=2**32)]  # seed of the split and of the models
    train_rows: Count  # number of training rows
    test_rows: Count  # number of test rows
    # largest area of the rows that are used [%]; None for all rows
    area_max: Annotated[float, Field(gt=0, le=100)] | None


class Comparison(Document):
    """The file comparison.json, which describes the data of a comparison."""

    conditions: Conditions  # conditions of all results
    database: str = ""  # name of the database's file
    # True if rows of one surface are in one part, False if rows were split one by one
    split_by_surface: bool = True
    # True if the surfaces are windows, split by tiles of their maps
    split_by_tile: bool = False
    unit: str  # unit of the target
    threads: Count  # number of threads of each fit


class Times(Document):
    """Times of a fit and of its predictions [s].

    A fit that failed has None; files of earlier versions may have NaN in its place.
    """

    model_config = ConfigDict(allow_inf_nan=True)

    fit: float | None  # median time of a fit to all training rows
    fits: Count  # number of fits of this median
    test: float | None  # median time of predicting the whole test set
    row: float | None  # median time of predicting one row
    search: Seconds  # sum of the times of all fits of the search, 0 without one


class SearchReport(Document):
    """A report of the search that chose the settings of a result.

    Lists of R2 have a number for each fold [%], and are empty unless there is a score on all folds.
    """

    how: str  # steps of the search in words
    grid: str = grids.TABLE_2  # name of the grid
    rows: Count  # number of training rows; the search decided by their folds
    candidates: Count  # number of candidates of the grid
    # number of candidates that lead to different computations
    candidates_differing: Count
    candidates_scored: Count  # number of differing candidates with a score on all folds
    fits_nominal: Count  # number of fits if each served one candidate only
    fits: Count  # number of finished fits to all rows
    baseline_fits: Count = 0  # number of folds on which the baseline has a score
    # number of judged candidates that a winner needs
    enough: Count = grids.LEAST_JUDGED
    winner: Literal["grid", "optimum", "baseline"] | None = None  # origin of the winner
    # settings of the best candidate that are at an end of all values that were tried
    ends: list[str] = Field(default_factory=list)
    r2_folds: list[Score]  # R2 of the winner
    grid_r2_folds: list[Score] = Field(default_factory=list)  # R2 of the best candidate
    # R2 of the optimum: the paper's, or the default point of a grid for features without units
    optimum_r2_folds: list[Score] = Field(default_factory=list)
    baseline_r2_folds: list[Score] = Field(default_factory=list)  # R2 of the baseline
    failures: dict[str, Count]  # number of missing scores by the reason of the failure
    # number of scores whose fit had a warning, by the text of the warning
    remarks: dict[str, Count] = Field(default_factory=dict)


class Result(Document):
    """A file KIND/MODEL.json.

    The file of a search without a winner has model, failure and remarks only.
    """

    model: str  # name of the model
    settings: dict[str, Setting] = Field(default_factory=dict)  # on top of the baseline's
    # values that the fit itself has chosen, by the keys of `learn.comparison.jobs.CHOSEN_BY_FIT`
    fitted: dict[str, str] = Field(default_factory=dict)
    test: StoredScores | None = None  # scores on the test rows
    train: StoredScores | None = None  # scores on the training rows
    failure: str  # why there are no scores; "" if there are some
    remarks: list[str]  # warnings of the fit
    search: SearchReport | None = None  # None if nothing was searched
    times: Times | None = None

    @field_validator("search", mode="before")
    @classmethod
    def _no_search(cls, search: object) -> object:
        """Return None for the empty object in the file of a baseline, else the report itself."""
        if search == {}:
            return None
        return search

    @model_validator(mode="after")
    def _scores_have_times(self) -> "Result":
        """Raise ValueError if there are scores without times of fit and predictions."""
        if self.test and not _are_complete(self.times):
            raise ValueError("there are scores without times of fit and predictions")
        return self

    @property
    def has_winner(self) -> bool:
        """Whether the result has settings; a search without a winner has none."""
        return "settings" in self.model_fields_set


def _are_complete(times: Times | None) -> bool:
    """Return whether the times of fit and predictions are all there, between 0 and `LONGEST`."""
    if times is None:
        return False
    for seconds in (times.fit, times.test, times.row):
        if seconds is None or not 0 <= seconds <= LONGEST:
            return False
    return True


@dataclass(frozen=True)
class StoredResult:
    """A result of a folder, with its model and kind."""

    model: str  # name of the model
    kind: str  # one of `KINDS`
    result: Result


@dataclass(frozen=True)
class Settings:
    """Settings of an estimator, and their origin."""

    # values by setting, on top of the settings of the model's baseline
    values: dict[str, Any]
    # True if the settings that all candidates of a search share are set too (`Model.tuned`)
    tuned: bool
    origin: str  # origin of the settings in words, for the user and for cards
    # folder of the target in the comparison whose search chose the settings; None without one
    folder: Path | None = None


class Predictions(NamedTuple):
    """The target of the m test rows of a result, in its unit."""

    truth: Values  # (m,), values in the database
    prediction: Values  # (m,), predicted values


def require_same(
    path: Path, stored: Mapping[str, Any], current: Mapping[str, Any]
) -> None:
    """Refuse a file or folder that was made under other conditions.

    Parameters
    ----------
    path : Path
        The file or folder, for the message.
    stored, current : mapping of str to object
        Conditions of the file and of this run, by their names. A missing condition equals None.

    Raises
    ------
    InputError
        If any condition differs; the message names the first one in alphabetical order.
    """
    for name in sorted(current.keys() | stored.keys()):
        if stored.get(name) != current.get(name):
            raise InputError(
                f"{path} was made with {name} {stored.get(name)!r}, not {current.get(name)!r}: give"
                " another folder, or the same database, options and versions"
            )


def conditions_of(dataset: Dataset, split: Split, request: Request) -> dict[str, Any]:
    """Return the conditions of results, as comparison.json has them.

    Parameters
    ----------
    dataset : Dataset
        Usable rows of one target.
    split : Split
        Positions of training and test rows among them.
    request : Request
        The comparison, with the options of the user.

    Returns
    -------
    dict
        Conditions by name, of types that JSON has. All fields of `Conditions` are among them,
        except `load` at the load Delta.
    """
    features = dataset.features
    target_scaling = "none"
    if features.scaled:
        target_scaling = "standard"
    conditions = {
        "database_sha256": dataset.sha256,
        "target": dataset.target_name,
        "features": features.name,
        "inputs": list(features.columns),
        "normalisation": request.normalisation,
        "target_scaling": target_scaling,
        "seed": split.seed,
        "folds": FOLDS,
        "train_rows": int(split.train.size),
        "test_rows": int(split.test.size),
        "versions": versions(),
        "area_max": request.area_max,
    }
    # The load Delta is left out, because folders of earlier versions do not state it: their results
    # remain comparable. The only other load of a comparison is the pressure.
    if features.by_pressure:
        conditions["load"] = "pressure"
    return conditions


@dataclass(frozen=True)
class Folder:
    """The folder of one target in a comparison folder.

    Every method that reads raises InputError if a file is damaged. Every method that writes raises
    it if the file cannot be written.
    """

    path: Path  # folder of the target

    def begin(self, dataset: Dataset, split: Split, request: Request) -> None:
        """Write rows.csv and comparison.json, or compare conditions if the folder has them already.

        Parameters
        ----------
        dataset : Dataset
            Usable rows of this target.
        split : Split
            Positions of training and test rows among them.
        request : Request
            The comparison, with the options of the user.

        Raises
        ------
        InputError
            If the folder has results of other conditions or a damaged comparison.json, or a file
            cannot be written.
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
        groups = dataset.groups
        if not split.by_surface:  # Each row is a group of its own.
            groups = np.arange(dataset.size)
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
            The data, and the conditions of all results.

        Raises
        ------
        InputError
            If there is no such file, or it is damaged.
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

        Raises
        ------
        InputError
            If the file is damaged.
        """
        return documents.read(self.path / kind / f"{model}.json", Result)

    def results(self) -> Iterator[StoredResult]:
        """Yield all results of the folder.

        Yields
        ------
        StoredResult
            One result, in the order of the models in `EVERY` (that of the paper's Table 4), and for
            each model in the order of `KINDS`.

        Raises
        ------
        InputError
            If the file of a result is damaged.
        """
        for model in EVERY:
            for kind in KINDS:
                result = self.result(kind, model)
                if result is not None:
                    yield StoredResult(model=model, kind=kind, result=result)

    def winner(self, model: str) -> Settings | None:
        """Read the settings of the winner of a model's search.

        Settings outside the grid are refused: somebody may have edited the file, and a library may
        use up all memory or never end with other settings.

        Parameters
        ----------
        model : str
            Name of the model.

        Returns
        -------
        Settings or None
            Settings of the winner, which may be the baseline; None if the folder has no result of a
            search, or one without a winner.

        Raises
        ------
        InputError
            If a file is damaged, or comparison.json is missing; if a setting is neither in the grid
            nor among the values beyond its ends (`grid.reach`); or if a winning baseline has other
            settings than `grid.baseline`.
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
            return Settings(
                values=settings,
                tuned=False,
                origin=f"the baseline, by {self.path}",
                folder=self.path,
            )
        space = grids.space_of(model, features)
        for name, value in settings.items():
            if value not in grids.reach(name, space.values.get(name, [])):
                raise InputError(
                    f"{path}: {name} = {value!r} is not in the grid {space.name!r}"
                )
        return Settings(
            values=settings,
            tuned=True,
            origin=f"tuned in {self.path}",
            folder=self.path,
        )

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
            Truth and prediction of the test rows.

        Raises
        ------
        InputError
            If the table is missing or damaged.
        """
        truth, prediction = self.numbers(f"{kind}/{model}.csv", "truth", "prediction").T
        return Predictions(truth=truth, prediction=prediction)

    def numbers(self, name: str, *columns: str, part: str = "") -> Values:
        """Read columns of numbers from a CSV table of the folder.

        Parameters
        ----------
        name : str
            File name within the folder.
        *columns : str
            Names of the columns.
        part : str
            "train" or "test" for the rows with this word in the column `part`; "" for all rows.

        Returns
        -------
        ndarray, shape (rows, columns)
            The numbers, in the order of `columns`.

        Raises
        ------
        InputError
            If the table is missing or damaged, or the magnitude of a number is not below `LARGEST`
            (or NaN).
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
        if not (np.abs(table) < LARGEST).all():  # False for NaN, too
            raise InputError(f"{path}: holds values that are not finite: move it away")
        # Without rows the array has shape (0,): give it its columns.
        return table.reshape(-1, len(columns))

    def write_json(self, name: str, content: dict[str, Any]) -> Path:
        """Write a JSON file of the folder.

        Parameters
        ----------
        name : str
            File name within the folder.
        content : dict
            The document. Its values can be written as JSON, and its numbers are finite.

        Returns
        -------
        Path
            The file, within the folder.

        Raises
        ------
        InputError
            If the file cannot be written, or a link leads out of the folder.
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
            The file, within the folder.

        Raises
        ------
        InputError
            If the file cannot be written, or a link leads out of the folder.
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
    """Return a stored setting as grids write it: a list of JSON becomes a tuple."""
    if isinstance(value, list):  # The layers of a perceptron are a tuple in grids.
        return tuple(value)
    return value


def targets(path: Path) -> list[Folder]:
    """List the folders of the targets in a comparison folder.

    Parameters
    ----------
    path : Path
        The comparison folder.

    Returns
    -------
    list of Folder
        One folder or more, in the alphabetical order of their names.

    Raises
    ------
    InputError
        If no folder has a comparison.json.
    """
    names = sorted(record.parent.name for record in path.glob("*/comparison.json"))
    folders = [Folder(files.inside(path, name)) for name in names]
    if not folders:
        raise InputError(
            f"{path} holds no comparison: run learn compare or learn tune first"
        )
    return folders
