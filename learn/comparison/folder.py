"""A comparison folder: what was compared, under which conditions, and what came out.

    area/comparison.json        data, scene, options, seeds, versions: what every result rests on
    area/rows.csv               row of the database, part, fold
    area/trials/MODEL.jsonl     finished fits of a search (`learn.comparison.search.trials`)
    area/baseline/MODEL.json    settings, scores, times; MODEL.csv has the test rows' predictions
    area/tuned/MODEL.json       the same for a search's winner, and how it was found
    area/tuned/MODEL-grid.csv   every candidate of the grid with its scores
    area/whole-grid/MODEL.json  what the model's whole grid takes, estimated
    area/*.csv, *.png           the tables and pictures that `learn show` makes of them

One folder a target (here area). Files are written beside their place and then renamed.
"""

import csv
import json
from collections.abc import Iterable, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from gen.runtime import documents, output
from gen.runtime.errors import InputError
from gen.runtime.table import cell
from learn.arrays import Values
from learn.comparison import records
from learn.dataset import Dataset
from learn.features import chosen
from learn.split import FOLDS, Split

LIBRARIES = ("numpy", "scipy", "scikit-learn", "xgboost-cpu")
KINDS = ("baseline", "tuned")

LARGEST = 1e30
"""Values of targets are below: those of a picture have to fit into its axes."""

EARLIER = {"features": "paper", "target_scaling": "none"}
"""Conditions of folders that are older than the choice."""


def versions() -> dict[str, str]:
    """Versions of what decides the numbers; a library that is missing has none."""
    found = {}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = ""
    if not found["xgboost-cpu"]:
        try:
            found["xgboost-cpu"] = version("xgboost")
        except PackageNotFoundError:
            found["xgboost-cpu"] = ""
    return found


def conditions(
    dataset: Dataset, split: Split, normalisation: str, options: dict[str, Any]
) -> dict[str, Any]:
    """Describe what results rest on: two results can be compared if these are equal.

    Parameters
    ----------
    dataset, split : the rows
    normalisation : one of `learn.models.NORMALISATIONS`
    options : further choices of the user that decide the rows
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


class Folder:
    """One target's part of a comparison folder.

    Parameters
    ----------
    path : the folder of the target
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def begin(self, dataset: Dataset, split: Split, agreed: dict[str, Any]) -> None:
        """Make the folder, or check that it belongs to the same data and choices.

        Raises
        ------
        InputError
            If it belongs to others, or cannot be written.
        """
        record = self.path / "comparison.json"
        if record.exists():
            found = EARLIER | self.record()["conditions"]
            for name in sorted(agreed.keys() | found.keys()):
                if found.get(name) != agreed.get(name):
                    raise InputError(
                        f"{self.path} was made with {name} {found.get(name)!r}, not"
                        f" {agreed.get(name)!r}: give another folder, or the same database, options"
                        " and versions"
                    )
            return
        self.write_table("rows.csv", ("row", "part", "fold"), _rows(dataset, split))
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
                "unit": dataset.unit,
                "threads": 1,
            },
        )

    def record(self) -> dict[str, Any]:
        """Read what the folder rests on."""
        record = documents.read(self.path / "comparison.json", records.Comparison)
        if record is None:
            raise InputError(f"{self.path} is no comparison: run learn compare or learn tune first")
        return record

    def result(self, kind: str, model: str) -> dict[str, Any] | None:
        """Read the result of a model, None if there is none."""
        return documents.read(self.path / kind / f"{model}.json", *records.KINDS[kind])

    def prediction(self, kind: str, model: str) -> tuple[Values, Values]:
        """Read truth and prediction of the test rows, (m,) each."""
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

    def write_json(self, name: str, content: dict[str, Any]) -> Path:
        """Write a file of the folder."""
        return self._write(name, json.dumps(content, indent=1) + "\n")

    def write_table(
        self, name: str, header: Sequence[str], rows: Iterable[Sequence[object]]
    ) -> Path:
        """Write a table of the folder (CSV)."""
        lines: list[str] = []

        class Lines:
            write = lines.append

        writer = csv.writer(Lines(), lineterminator="\n")
        writer.writerow(header)
        writer.writerows([cell(each) for each in row] for row in rows)
        return self._write(name, "".join(lines))

    def _write(self, name: str, text: str) -> Path:
        path = self.path / name
        output.make_folder(path.parent)
        output.write(path, text)
        return path


def targets(path: Path) -> list[Folder]:
    """Find the targets of a comparison folder.

    Raises
    ------
    InputError
        If it has none.
    """
    found = [Folder(each.parent) for each in sorted(path.glob("*/comparison.json"))]
    if not found:
        raise InputError(f"{path} holds no comparison: run learn compare or learn tune first")
    return found


def _rows(dataset: Dataset, split: Split) -> Iterable[tuple[object, ...]]:
    for position, fold in zip(split.train, split.folds, strict=True):
        yield int(dataset.rows[position]), "train", int(fold)
    for position in split.test:
        yield int(dataset.rows[position]), "test", ""
