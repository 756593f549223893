"""The model card: data, settings, scores, intervals and training ranges of a surrogate."""

from collections.abc import Iterator
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np

from gen.runtime.errors import InputError
from gen.runtime.terminal import printable
from gen.scene import Scene
from learn.arrays import Indices
from learn.comparison.folder import versions
from learn.dataset import Dataset
from learn.features import chosen
from learn.features.hardness import hardness_limits, modulus
from learn.metrics import scores
from learn.models import MODELS
from learn.request import Request
from learn.surrogate import ranges
from learn.surrogate.conformal import coverage
from learn.surrogate.learnt import Learnt

if TYPE_CHECKING:
    from rich.table import Table

    from learn.surrogate.model import Surrogate

LEVELS = (0.5, 0.9, 0.95)
"""Intervals whose coverage is reported."""

LICENCE = "BSD-3-Clause"
LIBRARIES = ("asperity", "mapie")


def make(
    request: Request,
    rows: Dataset,
    parts: tuple[Indices, Indices, Indices],
    judged: dict[str, dict[str, Any]],
) -> dict[str, Any]:
    """Assemble the card, of numbers, texts, lists and dictionaries only."""
    scene = Scene.from_text(rows.source["scene"])
    limits, boundary = hardness_limits(scene), scene.contact.boundary
    features = chosen(request.features, limits)
    train, calibration, test = parts
    (model,) = request.models
    return {
        "title": f"{MODELS[model].title} for {', '.join(request.targets)}",
        "model": model,
        "features": features.name,
        "columns": [list(pair) for pair in zip(features.columns, features.units, strict=True)],
        "normalisation": request.normalisation,
        "targets": judged,
        "scene": scene.text(),
        "nodes": scene.nodes,
        "side": scene.surface.side,
        "spacing": scene.spacing,
        "modulus": modulus(scene),
        **({} if boundary == "free" else {"boundary": boundary}),
        **({} if limits is None else {"hardness_ratio": list(limits)}),
        "delta": [float(end) for end in _ends(rows.described[train, 0])],
        "area_max": request.area_max,
        "rows": {
            "train": int(train.size),
            "calibration": int(calibration.size),
            "test": int(test.size),
            "left_out": {why: int(number) for why, number in rows.dropped.items()},
        },
        "seed": request.seed,
        "database": rows.source["database"],
        "database_sha256": rows.source["database_sha256"],
        "versions": {**{name: _version(name) for name in LIBRARIES}, **versions()},
        "licence": LICENCE,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def judge(learnt: Learnt, rows: Dataset, test: Indices) -> dict[str, Any]:
    """Score the model of a target and its intervals on the test rows, in the target's unit."""
    from learn.surrogate.model import CEILING

    raw, scale = learnt.raw(rows.inputs[test]), rows.scale[test]
    truth = rows.target[test]
    ceiling = CEILING.get(learnt.column, np.inf)
    scored = vars(scores(truth * scale, np.clip(raw * scale, 0.0, ceiling)))
    covered = [
        {
            "level": level,
            "coverage": share,
            "mean_width": float(np.mean(_width(raw, half, scale, ceiling))),
        }
        for level, share, half in coverage(learnt.calibration, raw, truth, LEVELS)
    ]
    low, high = _ends(truth * scale)
    return {
        "column": learnt.column,
        "unit": learnt.unit,
        "range": [float(low), float(high)],
        "scores": {name: float(value) for name, value in scored.items()},
        "intervals": covered,
        "ranges_of_prediction": int(learnt.calibration.borders.size + 1),
    }


def _width(raw: Any, half: Any, scale: Any, ceiling: float) -> Any:
    """Return the widths of the intervals, cut at the bounds of the target."""
    return np.clip((raw + half) * scale, 0.0, ceiling) - np.clip((raw - half) * scale, 0.0, ceiling)


def lines(surrogate: "Surrogate") -> Iterator[str]:
    """Yield the lines of the card, without its tables."""
    card = surrogate.card
    yield f"{card['title']}, {card['features']} features, normalised: {card['normalisation']}"
    rows = card["rows"]
    left_out = sum(rows["left_out"].values())
    yield (
        f"rows      {rows['train']} trained, {rows['calibration']} calibrated, {rows['test']}"
        f" tested (split by surface, seed {card['seed']}); {left_out} left out"
    )
    limit = "" if card["area_max"] is None else f", areas to {card['area_max']:g} %"
    yield (
        f"trained   on {card['nodes']} x {card['nodes']} nodes, side {card['side']:g} um, Delta"
        f" {card['delta'][0]:.4g} to {card['delta'][1]:.4g} um, E* {card['modulus']:g} MPa{limit}"
        f"{_hardness(card)}{_boundary(card)}"
    )
    for name, target in card["targets"].items():
        settings = ", ".join(f"{key}={value}" for key, value in target["settings"].items())
        yield f"{name:9} {settings} ({target['settings_from']})"
        for remark in target["remarks"]:
            yield f"          warning: {remark}"
    yield f"data      {card['database']}, sha256 {card['database_sha256'][:16]}"
    yield f"scene     {card['scene']}"
    named = ", ".join(f"{name} {number}" for name, number in card["versions"].items() if number)
    yield f"versions  {named}"
    yield f"made      {card['made']}, licence {card['licence']}"


def _hardness(card: dict[str, Any]) -> str:
    """Describe the hardness of the training; "" for elastic bodies."""
    limits = card.get("hardness_ratio")
    return "" if limits is None else f", hardness {ranges.between(limits)} E*"


def _boundary(card: dict[str, Any]) -> str:
    """Describe the boundary of patches without edges; "" for free ones."""
    boundary = ranges.boundary_of(card)
    return "" if boundary == "free" else f", {boundary} boundary"


def show(surrogate: "Surrogate") -> None:
    """Print the card with its tables: scores, coverage of the intervals, training ranges.

    Raises
    ------
    InputError
        If an entry of the card is missing, so that the file is not from `learn fit`.
    """
    from gen.runtime.console import wide_console

    try:
        texts = list(lines(surrogate))
        tables = [_scores(surrogate), _intervals(surrogate), _ranges(surrogate)]
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        fault = printable(f"{type(error).__name__}: {error}")
        raise InputError(f"the surrogate's card is not whole ({fault}): fit it anew") from None
    console = wide_console(120)
    for text in texts:
        console.print(printable(text), highlight=False, markup=False, soft_wrap=True)
    for table in tables:
        console.print(table)


def _scores(surrogate: "Surrogate") -> "Table":
    table = _table("Scores on the test rows [%]", "Target", "Unit")
    for column in ("from", "to", "nMSE", "nMAE", "nMaxE", "R2"):
        table.add_column(column, justify="right")
    for name, target in surrogate.card["targets"].items():
        scores, (low, high) = target["scores"], target["range"]
        nmse = f"{scores['nmse']:.3f}" if target["column"] == "area_percent" else "-"
        others = (f"{scores[score]:.3f}" for score in ("nmae", "nmaxe", "r2"))
        ends = f"{low:.4g}", f"{high:.4g}"
        table.add_row(_plain(name), _plain(target["unit"]), *ends, nmse, *others)
    return table


def _intervals(surrogate: "Surrogate") -> "Table":
    table = _table("Conformal intervals on the test rows", "Target")
    for column in ("wanted", "covered", "mean width"):
        table.add_column(column, justify="right")
    for name, target in surrogate.card["targets"].items():
        for each in target["intervals"]:
            wanted, covered = f"{100 * each['level']:.0f} %", f"{100 * each['coverage']:.1f} %"
            width = f"{each['mean_width']:.4g} {target['unit']}"
            table.add_row(_plain(name), wanted, covered, _plain(width))
    return table


def _ranges(surrogate: "Surrogate") -> "Table":
    table = _table("Inputs and their training ranges", "Input", "Unit")
    for column in ("from", "to"):
        table.add_column(column, justify="right")
    for (name, unit), low, high in zip(
        surrogate.card["columns"], surrogate.low, surrogate.high, strict=True
    ):
        table.add_row(_plain(name), _plain(unit), f"{low:.5g}", f"{high:.5g}")
    return table


def _table(title: str, *names: str) -> "Table":
    from rich.table import Table

    table = Table(title=title)
    for name in names:
        table.add_column(name)
    return table


def _plain(text: Any) -> str:
    """Return a text of the file as a cell, without markup and control characters."""
    from rich.markup import escape

    return escape(printable(str(text)))


def _ends(values: Any) -> tuple[Any, Any]:
    return values.min(), values.max()


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""
