"""The usable rows of one database for one target, as `learn` reads them."""

from pathlib import Path
from typing import Any

from learn import dataset
from learn.dataset import Dataset, Request


def read(path: Path, target: str = "area", **options: Any) -> Dataset:
    """Read a database with further options of a request."""
    (rows,) = dataset.read(Request((path,), targets=(target,), **options))
    return rows
