"""The model card: data, settings, scores, intervals and training ranges of a surrogate."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices, Values
from gen.runtime import VERSION
from gen.runtime.errors import InputError
from gen.runtime.terminal import echo, print_columns, printable
from learn.database_rows import Dataset, Origin
from learn.dataset import Request
from learn.features.scene import SCENE, plain, shown
from learn.features.sets import limits_of
from learn.metrics import magnitude, no_better, scores
from learn.models import EVERY, versions
from learn.surrogate.calibration import FEWEST
from learn.surrogate.interval import USUAL_LEVEL, calibrated_by
from learn.surrogate.learnt import Fit, Learnt
from learn.surrogate.training import between

LEVELS = (0.5, 0.9, 0.95)  # levels of intervals whose coverage is reported
MIDDLE = 1  # place of the level whose coverage is reported for each database
# what the intervals of one model and set of features hold (`bench/results/coverage`)
MEASURED = (
    "          measured on 27 kinds of surfaces that were not trained on (bench coverage): 94 % of"
    " the rows without a flag lie in their 90 % interval, of the worst kind 86 %"
)


@dataclass(frozen=True)
class Table:
    """A table of a card."""

    title: str
    names: list[str]  # headings of the columns of names, which stand first
    numbers: list[str]  # headings of the columns of numbers
    rows: list[list[str]]


def make(
    request: Request,
    rows: Dataset,
    train: Indices,
    sizes: Mapping[str, int],
    entries: dict[str, dict[str, Any]],
) -> dict[str, Any]:
    """Assemble the card of numbers, texts, lists and dictionaries only.

    Parameters
    ----------
    request : Request
        The fit, of one model.
    rows : Dataset
        The usable rows.
    train : ndarray, shape (m,)
        Positions of the training rows.
    sizes : mapping of str to int
        Numbers of the rows that "train", "calibration" and "test" have.
    entries : dict of str to dict
        Entries of the targets, from `judge`.

    Returns
    -------
    dict of str to object
        The card, which JSON can hold.
    """
    (model,) = request.models
    features = rows.features
    scene = rows.origins[0].scene
    databases = [_database_of(origin) for origin in rows.origins]
    columns = zip(features.columns, features.units, strict=True)
    divided: dict[str, Any] = {"split_by": "tile"} if rows.by_tile else {}
    left_out = {reason: int(number) for reason, number in rows.dropped.items()}
    return {
        "title": f"{EVERY[model].title} for {', '.join(request.targets)}",
        "model": model,
        "features": features.name,
        "columns": [list(pair) for pair in columns],
        "normalisation": request.normalisation,
        "targets": entries,
        "scene": databases[0]["scene"],
        "nodes": databases[0]["nodes"],
        "side": databases[0]["side"],
        "spacing": list(scene.grid.spacing),
        "modulus": scene.contact.e_star,
        **_unusual(rows, databases),
        "delta": np.quantile(rows.described[train, 0], (0, 1)).tolist(),
        "area_max": request.area_max,
        "rows": {
            **{name: int(size) for name, size in sizes.items()},
            **divided,
            "left_out": left_out,
        },
        "seed": request.seed,
        "database": rows.name,
        "database_sha256": rows.sha256,
        "versions": {"asperity": VERSION, **versions()},
        "licence": "BSD-3-Clause",
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def _database_of(origin: Origin) -> dict[str, Any]:
    """Return what a card states of a database."""
    scene = origin.scene
    return {
        "database": origin.database,
        "sha256": origin.sha256,
        "rows": origin.rows,
        "generator": str(getattr(scene.surface, "generator", "")),
        "nodes": list(scene.grid.shape),
        "side": list(scene.grid.sides),
        "scene": scene.text(),
    }


def _unusual(rows: Dataset, databases: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the entries of a card that stand only where they differ from the usual."""
    features = rows.features
    unusual: dict[str, Any] = {}
    if features.rooted:
        unusual["roots"] = features.rooted
    if features.blocks:
        unusual["blocks"] = features.blocks
    boundary = rows.origins[0].scene.contact.boundary
    if boundary != "free":
        unusual["boundary"] = boundary
    limits = limits_of([origin.scene for origin in rows.origins])
    if limits is not None:
        unusual["hardness_ratio"] = list(limits)
    if features.elastic:
        unusual["elastic"] = features.elastic
    if features.of_scene or features.load != "delta":
        unusual["load"] = features.load
    if len(databases) > 1:
        unusual["databases"] = databases
    return unusual


def judge(fitted: Fit, rows: Dataset, test: Indices) -> dict[str, Any]:
    """Judge the model of a target and its intervals on the test rows.

    Parameters
    ----------
    fitted : Fit
        The model, and how it was fitted.
    rows : Dataset
        The usable rows.
    test : ndarray, shape (k,)
        Positions of the test rows.

    Returns
    -------
    dict of str to object
        The target's entry of the card. Scores are in percent, numbers without a unit in their name
        are in the target's unit.
    """
    learnt = fitted.learnt
    tested = rows.at(test)
    raw = learnt.raw(tested.inputs)
    intervals = [_judge_intervals(learnt, tested, raw, level) for level in LEVELS]
    model_scores = scores_of(learnt, tested, raw)
    remarks = list(fitted.remarks)
    fault = no_better(model_scores["r2"])
    if fault:
        remarks.append(fault)
    by_database: dict[str, Any] = {}
    if len(rows.origins) > 1:
        inside = intervals[MIDDLE].inside
        by_database["databases"] = _by_database(learnt, tested, raw, inside)
    settings = sorted(fitted.settings.values.items())
    return {
        **by_database,
        "column": learnt.column,
        "unit": learnt.unit,
        "range": np.quantile(tested.target * tested.scale, (0, 1)).tolist(),
        "scores": model_scores,
        "intervals": [judged.entry for judged in intervals],
        "settings": {name: str(value) for name, value in settings},
        "settings_from": fitted.settings.origin,
        "fit_seconds": fitted.fitting,
        "remarks": remarks,
    }


@dataclass(frozen=True, eq=False)
class _JudgedIntervals:
    """The intervals of a level, judged on the test rows."""

    inside: NDArray[np.bool_]  # (k,), rows whose interval holds the truth
    entry: dict[str, float]  # level, coverage and mean width for the card


def _judge_intervals(
    learnt: Learnt, tested: Dataset, raw: Values, level: float
) -> _JudgedIntervals:
    """Judge intervals of a level about predictions of test rows over their scale, (k,)."""
    low, high = learnt.calibration.ends(raw, level, tested.inputs)
    inside = (low <= tested.target) & (tested.target <= high)
    smallest = np.clip(low * tested.scale, *learnt.bounds)
    largest = np.clip(high * tested.scale, *learnt.bounds)
    entry = {
        "level": level,
        "coverage": float(inside.mean()),
        "mean_width": float((largest - smallest).mean()),
    }
    return _JudgedIntervals(inside, entry)


def scores_of(learnt: Learnt, rows: Dataset, raw: Values) -> dict[str, float]:
    """Score predictions.

    Parameters
    ----------
    learnt : Learnt
        The model of the target.
    rows : Dataset
        n rows.
    raw : ndarray, shape (n,)
        Their predictions over the scale of the target.

    Returns
    -------
    dict of str to float
        The four scores by their names [%].
    """
    predicted = np.clip(raw * rows.scale, *learnt.bounds)
    return dict(vars(scores(rows.target * rows.scale, predicted)))


def _by_database(
    learnt: Learnt, tested: Dataset, raw: Values, inside: NDArray[np.bool_]
) -> list[dict[str, Any]]:
    """Score the model on the test rows of each database; NaN where there are none.

    The nMAE is NaN, too, where a target is 0 in all of them; the mean error says more there.
    `inside` tells of each row whether its interval holds the truth, (k,).
    """
    truth = tested.target * tested.scale
    errors = np.abs(np.clip(raw * tested.scale, *learnt.bounds) - truth)
    entries = []
    for number in range(len(tested.origins)):
        rows = tested.database == number
        nmae = math.nan
        mae = math.nan
        coverage = math.nan
        if rows.any():
            mae = float(errors[rows].mean())
            coverage = float(inside[rows].mean())
            size = magnitude(truth[rows])
            if size:
                nmae = 100 * mae / size
        entries.append(
            {"rows": int(rows.sum()), "nmae": nmae, "mae": mae, "coverage": coverage}
        )
    return entries


def show(card: Mapping[str, Any], low: Values, high: Values) -> None:
    """Print a card with its tables to stdout.

    Parameters
    ----------
    card : mapping of str to object
        The card.
    low, high : ndarray, shape (d,)
        Training ranges of the features.

    Raises
    ------
    InputError
        If an entry of the card is missing or malformed.
    """
    try:
        texts = list(lines(card))
        tables = [_scores(card), _ranges(card, low, high)]
        if "databases" in card:
            tables.insert(0, _databases(card))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        fault = printable(f"{type(error).__name__}: {error}")
        raise InputError(
            f"the surrogate's card is not whole ({fault}): fit it anew"
        ) from None
    for text in texts:
        echo(text)
    for table in tables:
        echo("")
        echo(table.title)
        print_columns(table.rows, [*table.names, *table.numbers], right=table.numbers)


def lines(card: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of a card, without its tables.

    Parameters
    ----------
    card : mapping of str to object
        The card.

    Yields
    ------
    str
        A line.
    """
    yield f"{card['title']}, {card['features']} features, normalised: {card['normalisation']}"
    rows = card["rows"]
    yield (
        f"rows      {rows['train']} trained, {rows['calibration']} calibrated, {rows['test']}"
        f" tested (split by {rows.get('split_by', 'surface')}, seed {card['seed']});"
        f" {sum(rows['left_out'].values())} left out"
    )
    yield f"trained   on {_training(card)}"
    for name, target in card["targets"].items():
        yield from _target_lines(name, target)
    yield from _interval_lines(card)
    if card["model"] == "kernel-ridge" and card["features"] == "hybrid":
        yield MEASURED
    if "grown" in card:
        yield _growth_line(card["grown"])
    alone = {**card, "sha256": card["database_sha256"]}
    for entry in card.get("databases", [alone]):
        yield f"data      {entry['database']}, sha256 {entry['sha256'][:16]}"
        yield f"scene     {entry['scene']}"
    libraries = [
        f"{name} {number}" for name, number in card["versions"].items() if number
    ]
    yield f"versions  {', '.join(libraries)}"
    yield f"made      {card['made']}, licence {card['licence']}"


def _target_lines(name: str, target: Mapping[str, Any]) -> Iterator[str]:
    """Yield settings, scores of rows left out in turn, and warnings of a target."""
    settings = ", ".join(f"{key}={value}" for key, value in target["settings"].items())
    yield f"{name:9} {settings} ({target['settings_from']})"
    if "left_out" in target:
        r2 = target["left_out"]["r2"]
        nmae = target["left_out"]["nmae"]
        yield f"          left out in turn: R2 {r2:.3f} %, nMAE {nmae:.2f} %"
    for remark in target["remarks"]:
        yield f"          warning: {remark}"


def _growth_line(grown: Mapping[str, Any]) -> str:
    """Return the line on the accuracy that a surrogate was grown to."""
    bounds = [f"{name} {bound:.3g} %" for name, bound in grown["bounds"].items()]
    met = "met" if grown["met"] else "not met"
    return (
        f"grown     to an nMAE of {grown['mark']:g} %: {met}, with {grown['rows']} rows; at"
        f" most {', '.join(bounds)}"
    )


def _interval_lines(card: Mapping[str, Any]) -> Iterator[str]:
    """Yield what calibrates intervals, what they hold for, and their largest level."""
    entry = card.get("calibration")
    if entry is None:
        return
    kinds = f"{entry['kind']}s"
    how = ", each predicted without it"
    if entry["database"]:
        how = f" of {entry['database']}"
    holding = f"other {kinds} like these"
    if entry["scheme"] == "each":
        holding = (
            f"further surfaces of these {kinds}; for others, {FEWEST} or more are needed"
        )
    yield f"intervals calibrated by {calibrated_by(card)}{how}: hold for {holding}"
    largest = entry.get("largest_level")
    if largest is None and entry["scheme"] != "each":  # a file of 1.0.0
        groups = entry["groups"]
        largest = math.floor(1000 * groups / (groups + 1)) / 1000
    if largest is not None:
        yield f"          {level_line(largest)}"


def level_line(largest: float) -> str:
    """Return the line on the largest level of intervals.

    Parameters
    ----------
    largest : float
        The largest level that the calibration reaches.

    Returns
    -------
    str
        The line; a warning if answers get a lower level than the usual one by default.
    """
    if largest >= USUAL_LEVEL:
        return f"intervals hold up to a level of {100 * largest:g} %"
    return (
        f"warning: intervals hold up to a level of {100 * largest:g} % only, which questions get"
        f" unless they ask for less; {100 * USUAL_LEVEL:g} % take more surfaces or maps"
    )


def _training(card: Mapping[str, Any]) -> str:
    """Return patches, loads and bodies of the training in words."""
    patches = [_patch_text(entry) for entry in card.get("databases", [card])]
    text = (
        f"{' and '.join(dict.fromkeys(patches))}, Delta {card['delta'][0]:.4g} to"
        f" {card['delta'][1]:.4g} um, E* {card['modulus']:g} MPa"
    )
    if card["area_max"] is not None:
        text += f", areas to {card['area_max']:g} %"
    limits = card.get("hardness_ratio")
    if limits is not None:
        text += f", hardness {between(limits)} E*"
        if card.get("elastic"):
            text += ", and elastic bodies"
    boundary = card.get("boundary", "free")
    if boundary != "free":
        text += f", {boundary} boundary"
    return text


def _patch_text(entry: Mapping[str, Any]) -> str:
    """Return nodes and sides of a database in words."""
    nx, ny = entry["nodes"]
    x, y = entry["side"]
    if x == y:
        return f"{nx:g} x {ny:g} nodes, side {x:g} um"
    return f"{nx:g} x {ny:g} nodes, sides {x:g} x {y:g} um"


def _scores(card: Mapping[str, Any]) -> Table:
    """Return the table of scores and coverages on the test rows."""
    rows = []
    for name, target in card["targets"].items():
        target_scores = target["scores"]
        low, high = target["range"]
        nmse = "-"  # it carries the unit of the target, and is given for areas only
        if target["column"] == "area_percent":
            nmse = f"{target_scores['nmse']:.3f}"
        row = [name, str(target["unit"]), f"{low:.4g}", f"{high:.4g}", nmse]
        row += [f"{target_scores[score]:.3f}" for score in ("nmae", "nmaxe", "r2")]
        row += [f"{100 * entry['coverage']:.1f}" for entry in target["intervals"]]
        rows.append(row)
    inside = [f"in {100 * level:g} %" for level in LEVELS]
    return Table(
        title="Scores on the test rows [%], and shares of these inside their intervals [%]",
        names=["Target", "Unit"],
        numbers=["from", "to", "nMSE", "nMAE", "nMaxE", "R2", *inside],
        rows=rows,
    )


def _databases(card: Mapping[str, Any]) -> Table:
    """Return the table of the databases, with scores on the test rows of each."""
    numbers = ["rows", "tested"]
    for name, target in card["targets"].items():
        error = "mean error"
        if target["unit"] != "1":
            error = f"mean error [{target['unit']}]"
        numbers += [
            f"{name}: nMAE [%]",
            f"{name}: {error}",
            f"{name}: in {100 * LEVELS[MIDDLE]:g} %",
        ]
    rows = []
    for place, database in enumerate(card["databases"]):
        entries = [target["databases"][place] for target in card["targets"].values()]
        row = [
            str(database["database"]),
            str(database["generator"]),
            f"{database['nodes'][0]:g} x {database['nodes'][1]:g}",
            str(database["rows"]),
            str(entries[0]["rows"]),
        ]
        for entry in entries:
            nmae = f"{entry['nmae']:.3f}" if np.isfinite(entry["nmae"]) else "-"
            row += [nmae, f"{entry['mae']:.3g}", f"{100 * entry['coverage']:.1f} %"]
        rows.append(row)
    return Table(
        title="Databases, and scores on their test rows",
        names=["Database", "Generator", "Nodes"],
        numbers=numbers,
        rows=rows,
    )


def _ranges(card: Mapping[str, Any], low: Values, high: Values) -> Table:
    """Return the table of the inputs; for a scene, of its numbers instead of their logarithms."""
    names = [name for name, _ in card["columns"]]
    units = [unit for _, unit in card["columns"]]
    if card["features"] == SCENE:
        low = shown(names, low)
        high = shown(names, high)
        names = [plain(name) for name in names]
    rows = [
        [str(name), str(unit), f"{smallest:.5g}", f"{largest:.5g}"]
        for name, unit, smallest, largest in zip(names, units, low, high, strict=True)
    ]
    return Table(
        title="Inputs and their training ranges",
        names=["Input", "Unit"],
        numbers=["from", "to"],
        rows=rows,
    )
