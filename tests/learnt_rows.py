"""Databases that learn is tried on, their usable rows, and surrogates of them."""

from pathlib import Path
from typing import Any

from learn import cli, dataset
from learn.database_rows import Dataset
from learn.dataset import Request
from learn.executor import Executor
from learn.surrogate import Surrogate, fitting


def read(path: Path, target: str = "area", **options: Any) -> Dataset:
    """Read a database with further options of a request."""
    (rows,) = dataset.read(Request((path,), targets=(target,), **options))
    return rows


def surrogate_of(database: Path, *options: str, name: str = "") -> Path:
    """Run `learn fit` on a database; return the path of the surrogate beside it."""
    path = database.with_name(f"{name or database.stem}.surrogate")
    assert cli.main(["fit", str(database), "-o", str(path), *options]) == 0
    return path


def fitted(
    path: Path,
    model: str = "kernel-ridge",
    features: str = "dimensionless",
    **options: Any,
) -> Surrogate:
    """Fit a surrogate of area and force, or other targets, to a database."""
    targets = options.pop("targets", ("area", "force"))
    scaling = "l2" if features == "paper" else "standard"
    request = Request(
        (path,), path, targets, (model,), None, scaling, features, **options
    )
    found = fitting.fit(request, Executor(), lambda line: None)
    assert found is not None
    return found
