"""A comparison folder: the data and conditions of a comparison, and its results.

    area/comparison.json        conditions of all results: data, scene, options, seeds, versions
    area/rows.csv               row of the database, part, fold, group that is kept together
    area/trials/MODEL.jsonl     finished fits of a search (`learn.comparison.trials`)
    area/baseline/MODEL.json    settings, scores, times; MODEL.csv has the test rows' predictions
    area/tuned/MODEL.json       the same for a search's winner, and how it was searched
    area/tuned/MODEL-grid.csv   every candidate of the grid with its scores
    area/whole-grid/MODEL.json  estimated time of the model's whole grid
    area/*.csv, *.png           the tables and pictures that `learn show` makes of them

Each target has a folder (here area). Files are written beside their place and then renamed.
"""

import csv
import io
import json
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gen.runtime import documents, files
from gen.runtime.documents import cell
from gen.runtime.errors import InputError
from learn.arrays import Values
from learn.comparison import grid as grids
from learn.comparison import records
from learn.dataset import Dataset
from learn.features import chosen
from learn.models import MODELS
from learn.split import FOLDS, Split

LIBRARIES = ("numpy", "scipy", "scikit-learn", "xgboost-cpu")
"""Libraries whose versions decide the numbers."""

KINDS = ("baseline", "tuned")
"""Kinds of results, and the names of their folders."""

LARGEST = 1e30
"""Bound of the targets' values: the axes of a picture take no larger ones."""


def versions() -> dict[str, str]:
    """Return the versions of the libraries that decide the numbers, "" for a missing one."""
    installed = {name: _version(name) for name in LIBRARIES}
    installed["xgboost-cpu"] = installed["xgboost-cpu"] or _version("xgboost")
    return installed


def _version(library: str) -> str:
    """Return the version of a library, "" if it is not installed."""
    try:
        return version(library)
    except PackageNotFoundError:
        return ""


def conditions(
    dataset: Dataset, split: Split, normalisation: str, options: dict[str, Any]
) -> dict[str, Any]:
    """Describe the conditions of results: two results can be compared if these are equal.

    Parameters
    ----------
    dataset, split : Dataset, Split
        The rows.
    normalisation : str
        One of `learn.models.NORMALISATIONS`.
    options : dict
        Further choices of the user that decide the rows.
    """
    return {
        "database_sha256": dataset.source["database_sha256"],
        "target": dataset.target_name,
        "features": dataset.features,
        "inputs": list(dataset.names),
        "normalisation": normalisation,
        "target_scaling": "standard" if chosen(dataset.features).scaled else "none",
        "seed": split.seed,
        "folds": FOLDS,
        "train_rows": int(split.train.size),
        "test_rows": int(split.test.size),
        "versions": versions(),
        **options,
    }


class Winner(NamedTuple):
    """The winner of a search: its settings, and whether it is of the grid or the baseline."""

    settings: dict[str, Any]
    of_grid: bool


class Folder:
    """One target's part of a comparison folder, at a path."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def begin(self, dataset: Dataset, split: Split, agreed: dict[str, Any]) -> None:
        """Make the folder, or check that it belongs to the same data and choices.

        Parameters
        ----------
        dataset, split : Dataset, Split
            The rows.
        agreed : dict
            Conditions of all results, from `conditions`.

        Raises
        ------
        InputError
            If the folder belongs to another comparison, or cannot be written.
        """
        if (self.path / "comparison.json").exists():
            self._check(agreed)
            return
        self.write_table("rows.csv", ("row", "part", "fold", "group"), _rows(dataset, split))
        self.write_json(
            "comparison.json",
            {
                "conditions": agreed,
                "database": dataset.source["database"],
                "database_versions": json.loads(dataset.source["versions"]),
                "scene": json.loads(dataset.source["scene"]),
                "usable_rows": dataset.size,
                "dropped_rows": dataset.dropped,
                "surfaces": int(np.unique(dataset.groups).size),
                "split_by_surface": split.by_surface,
                "split_by_tile": dataset.by_tile,
                "unit": dataset.unit,
                "threads": 1,
            },
        )

    def _check(self, agreed: dict[str, Any]) -> None:
        """Refuse a folder that was made under other conditions, naming the first that differs."""
        stored = self.record()["conditions"]
        for name in sorted(agreed.keys() | stored.keys()):
            if stored.get(name) != agreed.get(name):
                raise InputError(
                    f"{self.path} was made with {name} {stored.get(name)!r}, not"
                    f" {agreed.get(name)!r}: give another folder, or the same database, options"
                    " and versions"
                )

    def record(self) -> dict[str, Any]:
        """Read the folder's description: the conditions of its results.

        Raises
        ------
        InputError
            If there is none, or it is damaged.
        """
        record = documents.read(self.path / "comparison.json", records.Comparison)
        if record is None:
            raise InputError(f"{self.path} is no comparison: run learn compare or learn tune first")
        return record

    def result(self, kind: str, model: str) -> dict[str, Any] | None:
        """Read the "baseline", "tuned" or "whole-grid" result of a model, None if there is none.

        Raises
        ------
        InputError
            If the file is damaged.
        """
        return documents.read(self.path / kind / f"{model}.json", *records.KINDS[kind])

    def results(self) -> Iterator[tuple[str, str, dict[str, Any]]]:
        """Yield model, kind and result of each result, in the order of the paper's Table 4."""
        for model in MODELS:
            for kind in KINDS:
                result = self.result(kind, model)
                if result is not None:
                    yield model, kind, result

    def winner(self, model: str) -> Winner | None:
        """Read the winner of a model's search, None if the folder has none.

        Somebody may have edited the file, and with settings outside the grid a library may use up
        all memory or never end.

        Raises
        ------
        InputError
            If the settings are not of the grid.
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
        if result["search"].get("winner") == "baseline":
            if settings != grids.baseline(model, features):
                raise InputError(f"{path}: settings = {settings!r} are not those of the baseline")
            return Winner(settings, of_grid=False)
        grid, space = grids.space_of(model, features)
        for name, value in settings.items():
            if value not in space.get(name, []):
                raise InputError(f"{path}: {name} = {value!r} is not in the grid {grid!r}")
        return Winner(settings, of_grid=True)

    def prediction(self, kind: str, model: str) -> tuple[Values, Values]:
        """Read truth and prediction of the test rows, each of shape (m,), in the target's unit.

        Raises
        ------
        InputError
            If the file is missing or damaged.
        """
        path = self.path / kind / f"{model}.csv"
        try:
            lines = documents.read_bytes(path).decode().splitlines()[1:]
            table = np.array([[float(cell) for cell in line.split(",")] for line in lines])
            truth, prediction = table[:, 1], table[:, 2]
        except (FileNotFoundError, ValueError, IndexError) as error:
            raise InputError(f"{path} cannot be read: {error}") from None
        if not (np.abs(table) < LARGEST).all():
            raise InputError(f"{path}: holds values that are not finite: move it away")
        return truth, prediction

    def test_groups(self) -> Values:
        """Read the group of each test row, in the order of the predictions; shape (m,).

        Rows of one surface, or of one tile of a map, are of one group.

        Raises
        ------
        InputError
            If the file is missing or damaged.
        """
        path = self.path / "rows.csv"
        try:
            rows = [*csv.DictReader(documents.read_bytes(path).decode().splitlines())]
            return np.array([float(row["group"]) for row in rows if row["part"] == "test"])
        except (FileNotFoundError, KeyError, ValueError, TypeError, csv.Error) as error:
            raise InputError(
                f"{path} cannot be read ({error}): learn compare DATABASE -o into a new folder"
                " makes it again"
            ) from None

    def write_json(self, name: str, content: dict[str, Any]) -> Path:
        """Write a JSON file of the folder, and return its path."""
        return self._write(name, documents.text_of(content))

    def write_table(
        self, name: str, header: Sequence[str], rows: Iterable[Sequence[object]]
    ) -> Path:
        """Write a table of the folder (CSV), and return its path.

        Parameters
        ----------
        name : str
            Path of the file inside the folder.
        header : sequence of str
            Names of the columns.
        rows : iterable of sequence
            The lines.
        """
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(map(cell, row) for row in rows)
        return self._write(name, text.getvalue())

    def _write(self, name: str, text: str) -> Path:
        path = self.path / name
        files.make_folder(path.parent)
        files.write(path, text)
        return path


def targets(path: Path) -> list[Folder]:
    """List the targets of a comparison folder.

    Raises
    ------
    InputError
        If it has none.
    """
    folders = [Folder(record.parent) for record in sorted(path.glob("*/comparison.json"))]
    if not folders:
        raise InputError(f"{path} holds no comparison: run learn compare or learn tune first")
    return folders


def _rows(dataset: Dataset, split: Split) -> Iterable[tuple[object, ...]]:
    """Yield the lines of rows.csv. Rows that were split one by one are groups of their own."""
    groups = dataset.groups if split.by_surface else np.arange(dataset.size)
    for position, fold in zip(split.train, split.folds, strict=True):
        yield int(dataset.rows[position]), "train", int(fold), int(groups[position])
    for position in split.test:
        yield int(dataset.rows[position]), "test", "", int(groups[position])
