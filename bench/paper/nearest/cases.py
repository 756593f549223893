"""What the shipped reading gives, and what another split or another line of the scene changes."""

import re
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

from bench.databases import generated
from bench.files import is_there
from bench.paper.facts import AREA_MAX
from bench.paper.nearest.baselines import baseline
from bench.paper.nearest.population import Rows
from bench.report import remark
from bench.table import read_table, write_rows
from gen.database import Reader
from gen.schema import Status
from gen.statistics import NAMES
from learn.comparison import paper
from learn.models import MODELS

NEAREST = "paper-nearest"  # the shipped scene
ERRORS = "nmse", "nmae", "nmaxe", "r2"


LINES: Mapping[str, dict[str, str]] = {
    "as shipped": {},
    "10 loads a surface": {"samples_per_surface": "10"},
    "Hurst exponents of 0.5 to 0.8": {"hurst": "[0.5, 0.8]"},
    "uniform pressure": {"kernel": '"uniform-pressure"'},
}
"""Databases by name: the lines of the shipped scene that they have otherwise."""


class Case(NamedTuple):
    """A database, a name in `LINES`, and how its rows are split, one of `baselines.SPLITS`."""

    database: str
    split: str


CASES = (
    Case("as shipped", "surfaces"),
    Case("10 loads a surface", "surfaces"),
    Case("10 loads a surface", "rows"),
    Case("Hurst exponents of 0.5 to 0.8", "surfaces"),
    Case("uniform pressure", "surfaces"),
)
"""All cases; the first one is nearest to the paper, and has no two rows of one surface."""


def scene_of(database: str, samples: int) -> str:
    """Return the scene of a database as TOML: the shipped one with other lines."""
    text = (files("gen") / "scenes" / f"{NEAREST}.toml").read_text(encoding="utf-8")
    for key, value in {"samples": f"{samples}", **LINES[database]}.items():
        text = re.sub(rf"^{key} = .*$", f"{key} = {value}", text, flags=re.MULTILINE)
    return text


def read(path: Path) -> Rows:
    """Read the finished rows of a database with areas up to the paper's largest."""
    with Reader(path) as reader:
        columns = {name: reader.column(name) for name in ("hurst", "delta", "area_percent", *NAMES)}
        surface, status = reader.column("surface"), reader.column("status")
    kept = (status == Status.DONE) & (columns["area_percent"] <= AREA_MAX)
    return Rows({name: values[kept] for name, values in columns.items()}, surface[kept])


def measure(folder: Path, samples: int) -> tuple[list[dict[str, Any]], dict[str, Rows]]:
    """Fit all models in all cases; go on where an earlier run was stopped.

    Parameters
    ----------
    folder : Path
        Place of the databases, and of the table of what is done, scores.csv.
    samples : int
        Rows of each database.

    Returns
    -------
    list of dict
        Scores and the paper's, of each case and model [%].
    dict of str to Rows
        The databases by name.
    """
    path = folder / "scores.csv"
    done: list[dict[str, Any]] = [*read_table(path)[1]] if is_there(path) else []
    known = {(row["samples"], row["database"], row["split"], row["model"]): row for row in done}
    databases: dict[str, Rows] = {}
    for case in CASES:
        name = case.database.replace(" ", "-")
        if case.database not in databases:
            place = generated(folder / "databases", name, scene_of(case.database, samples))
            databases[case.database] = read(place)
        for model in MODELS:
            key = (str(samples), case.database, case.split, model)
            if key not in known:
                row = dict(zip(("samples", "database", "split", "model"), key, strict=True))
                known[key] = row | _scores(databases[case.database], case, model)
                remark(f"{case.database}, split by {case.split}: {model}")
                write_rows(path, known.values())
    keys = [(str(samples), *case, model) for case in CASES for model in MODELS]
    wanted = [known.pop(key) for key in keys]
    write_rows(path, [*wanted, *known.values()])
    return wanted, databases


def _scores(rows: Rows, case: Case, model: str) -> dict[str, Any]:
    """Return the scores of a model in a case, beside the paper's [%]."""
    ours, theirs = baseline(model, rows, case.split), paper.TEST["baseline"][model]
    return {
        "rows": rows.target.size,
        **{name: getattr(ours, name) for name in ERRORS},
        **{f"paper_{name}": getattr(theirs, name) for name in ERRORS},
    }
