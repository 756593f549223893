"""The model card of a surrogate: its data, settings, scores, intervals and training ranges.

A card is a dictionary that JSON can hold. `make` and `judge` assemble it after a fit, the file of
the surrogate keeps it, and `show` prints it.
"""

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
from learn.features.columns import LAYER_DEPTH
from learn.features.layers import TrainedLayers, span_text
from learn.features.scene import SCENE, plain, shown
from learn.features.sets import limits_of
from learn.metrics import magnitude, no_better, scores
from learn.models import EVERY, versions
from learn.surrogate.calibration import FEWEST
from learn.surrogate.interval import USUAL_LEVEL, calibrated_by
from learn.surrogate.learnt import COMPARISON, Fit, Learnt
from learn.surrogate.training import hardness_range_text

# Levels of the intervals whose coverage is measured on the test rows.
LEVELS = (0.5, 0.9, 0.95)
# Index in `LEVELS` of the level, 90 %, whose coverage is also measured on each database.
MIDDLE = 1
# Line on the coverage that `bench coverage` has measured, for kernel ridge with hybrid features.
MEASURED = (
    "          measured on 27 kinds of surfaces that were not trained on (bench coverage): 94 % of"
    " the rows without a flag lie in their 90 % interval, of the worst kind 86 %"
)


@dataclass(frozen=True)
class Table:
    """A table of a card, as it is printed."""

    title: str  # line above the table
    names: list[str]  # headings of the first columns, which have names
    numbers: list[str]  # headings of the following columns, which have numbers
    rows: list[list[str]]  # cells of each row, in the order of the columns


def make(
    request: Request,
    rows: Dataset,
    train: Indices,
    sizes: Mapping[str, int],
    entries: dict[str, dict[str, Any]],
) -> dict[str, Any]:
    """Assemble the card of a fit.

    Parameters
    ----------
    request : Request
        The fit, of one model.
    rows : Dataset
        The usable rows.
    train : ndarray, shape (m,)
        Positions of the training rows among them.
    sizes : mapping of str to int
        Numbers of "train", "calibration" and "test" rows.
    entries : dict of str to dict
        Entries of the targets, from `judge`, by their short names.

    Returns
    -------
    dict of str to object
        The card without "calibration" and "own_scale", which the fit adds. All numbers, texts,
        lists and dictionaries in it can be written as JSON.
    """
    (model,) = request.models
    features = rows.features
    scene = rows.origins[0].scene
    databases = [_database_of(origin) for origin in rows.origins]
    columns = zip(features.columns, features.units, strict=True)
    numbers_of_rows: dict[str, Any] = {name: int(size) for name, size in sizes.items()}
    if rows.by_tile:
        numbers_of_rows["split_by"] = "tile"
    numbers_of_rows["left_out"] = {
        reason: int(number) for reason, number in rows.dropped.items()
    }
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
        # The first column of `described` is Delta; quantiles 0 and 1 are its ends.
        "delta": np.quantile(rows.described[train, 0], (0, 1)).tolist(),
        "area_max": request.area_max,
        "rows": numbers_of_rows,
        "seed": request.seed,
        "database": rows.name,
        "database_sha256": rows.sha256,
        "versions": {"asperity": VERSION, **versions()},
        "licence": "BSD-3-Clause",
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def _database_of(origin: Origin) -> dict[str, Any]:
    """Return the entry of a card for one database."""
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
    """Return the entries that a card has only if they differ from their default.

    `databases` are the entries of the databases, from `_database_of`.
    """
    features = rows.features
    unusual: dict[str, Any] = {}
    # The defaults are those of elastic bodies with free boundaries in one database, by Delta.
    if features.rooted:
        unusual["roots"] = features.rooted
    if features.blocks:
        unusual["blocks"] = features.blocks
    boundary = rows.origins[0].scene.contact.boundary
    if boundary != "free":
        unusual["boundary"] = boundary
    scenes = [origin.scene for origin in rows.origins]
    layers = TrainedLayers.of_scenes(scenes)
    if layers is not None:
        unusual["layer"] = layers.text
        unusual["layers"] = layers.entry
    limits = limits_of(scenes)
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
    """Score the model of a target and its intervals on the test rows.

    Parameters
    ----------
    fitted : Fit
        The model, and how it was fitted.
    rows : Dataset
        The usable rows.
    test : ndarray, shape (k,)
        Positions of the test rows among them.

    Returns
    -------
    dict of str to object
        The target's entry of the card. "scores" and "nmae" are in percent, "fit_seconds" is in
        seconds of processor time; "range", "mae" and "mean_width" are in the target's unit, and
        "coverage" is a share between 0 and 1. "databases" has one entry for each database, if there
        are several; "comparison" is the folder that the settings come from, if they do.

    Raises
    ------
    ValueError
        If the target is constant in the test rows, or a prediction is not finite.
    """
    learnt = fitted.learnt
    tested = rows.at(test)
    raw = learnt.raw(tested.inputs)
    intervals = [_judge_intervals(learnt, tested, raw, level) for level in LEVELS]
    entry: dict[str, Any] = {}
    if len(rows.origins) > 1:
        inside = intervals[MIDDLE].inside
        entry["databases"] = _scores_by_database(learnt, tested, raw, inside)
    model_scores = scores_of(learnt, tested, raw)
    remarks = list(fitted.remarks)
    fault = no_better(model_scores["r2"])
    if fault:
        remarks.append(fault)
    truth = tested.target * tested.scale
    settings = sorted(fitted.settings.values.items())
    entry |= {
        "column": learnt.column,
        "unit": learnt.unit,
        "range": np.quantile(truth, (0, 1)).tolist(),  # smallest and largest
        "scores": model_scores,
        "intervals": [judged.entry for judged in intervals],
        "settings": {name: str(value) for name, value in settings},
        "settings_from": fitted.settings.origin,
        "fit_seconds": fitted.fitting,
        "remarks": remarks,
    }
    if fitted.settings.folder is not None:
        entry[COMPARISON] = str(fitted.settings.folder)
    return entry


@dataclass(frozen=True, eq=False)
class _JudgedIntervals:
    """The intervals of one level on the test rows."""

    inside: NDArray[np.bool_]  # (k,), True for rows whose interval contains the truth
    # entry of the card: "level" and "coverage", between 0 and 1, and "mean_width" in the target's
    # unit
    entry: dict[str, float]


def _judge_intervals(
    learnt: Learnt, tested: Dataset, raw: Values, level: float
) -> _JudgedIntervals:
    """Measure coverage and mean width of the intervals of a level, 0 to 1, on the k test rows.

    `raw` are the predictions of the test rows over the target's scale, (k,).
    """
    # `low`, `high` and `tested.target` are over the target's scale.
    low, high = learnt.calibration.ends(raw, level, tested.inputs)
    # The truth is within the target's bounds: clipping the ends to them would not change `inside`.
    inside = (low <= tested.target) & (tested.target <= high)
    # Widths are those of the intervals that users see: in the target's unit, within its bounds.
    low_for_users = np.clip(low * tested.scale, *learnt.bounds)
    high_for_users = np.clip(high * tested.scale, *learnt.bounds)
    widths = high_for_users - low_for_users
    entry = {
        "level": level,
        "coverage": float(inside.mean()),
        "mean_width": float(widths.mean()),
    }
    return _JudgedIntervals(inside=inside, entry=entry)


def scores_of(learnt: Learnt, rows: Dataset, raw: Values) -> dict[str, float]:
    """Score the predictions of a target.

    Parameters
    ----------
    learnt : Learnt
        The model of the target.
    rows : Dataset
        n rows.
    raw : ndarray, shape (n,)
        Predictions of these rows over the scale of the target.

    Returns
    -------
    dict of str to float
        The scores "nmse", "nmae", "nmaxe" and "r2" [%]; see `learn.metrics.Scores`.

    Raises
    ------
    ValueError
        If the target is constant in the rows, or a prediction is not finite.
    """
    predicted = np.clip(raw * rows.scale, *learnt.bounds)
    return dict(vars(scores(rows.target * rows.scale, predicted)))


def _scores_by_database(
    learnt: Learnt, tested: Dataset, raw: Values, inside: NDArray[np.bool_]
) -> list[dict[str, Any]]:
    """Return the entry of each database: its number of test rows, and scores on these.

    The entries are "rows", "nmae" [%], "mae" in the target's unit, and "coverage", a share between
    0 and 1. The last three are NaN for a database without test rows; "nmae" is also NaN if the
    target is 0 in all of them. `raw` are the predictions of the k test rows over the target's
    scale, (k,), and `inside` is True for rows whose interval contains the truth, (k,).
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
    """Print the lines of a card, then its tables, to stdout.

    Parameters
    ----------
    card : mapping of str to object
        The card.
    low, high : ndarray, shape (d,)
        Smallest and largest value of each of the d features in the training.

    Raises
    ------
    InputError
        If an entry of the card is missing or malformed. Nothing is printed then.
    """
    # All texts and tables are made before the first one is printed, because any may be malformed.
    try:
        texts = list(lines(card))
        tables: list[Table] = []
        if "databases" in card:  # only cards of several databases have this entry
            tables.append(_table_of_databases(card))
        tables.append(_table_of_scores(card))
        tables.append(_table_of_ranges(card, low, high))
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
        headings = [*table.names, *table.numbers]
        print_columns(table.rows, headings, right=table.numbers)


def lines(card: Mapping[str, Any]) -> Iterator[str]:
    """Write the lines of a card, without its tables.

    Parameters
    ----------
    card : mapping of str to object
        The card.

    Yields
    ------
    str
        One line.

    Raises
    ------
    KeyError, TypeError, ValueError, AttributeError, IndexError
        If an entry of the card is missing or malformed.
    """
    yield f"{card['title']}, {card['features']} features, normalised: {card['normalisation']}"
    rows = card["rows"]
    yield (
        f"rows      {rows['train']} trained, {rows['calibration']} calibrated, {rows['test']}"
        f" tested (split by {rows.get('split_by', 'surface')}, seed {card['seed']});"
        f" {sum(rows['left_out'].values())} left out"
    )
    yield f"trained   on {_training_text(card)}"
    if "layers" in card:
        yield _layer_line(card)
    for name, target in card["targets"].items():
        yield from _target_lines(name, target)
    yield from _interval_lines(card)
    if card["model"] == "kernel-ridge" and card["features"] == "hybrid":
        yield MEASURED
    if "grown" in card:
        yield _growth_line(card["grown"])
    # The card of a single database has the entries of this database itself.
    only_database = {**card, "sha256": card["database_sha256"]}
    for entry in card.get("databases", [only_database]):
        yield f"data      {entry['database']}, sha256 {entry['sha256'][:16]}"
        yield f"scene     {entry['scene']}"
    # A library that was not installed when the card was made has no number.
    libraries = [
        f"{name} {number}" for name, number in card["versions"].items() if number
    ]
    yield f"versions  {', '.join(libraries)}"
    yield f"made      {card['made']}, licence {card['licence']}"


def _target_lines(name: str, target: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines on a target: its settings, scores of left out rows, and warnings.

    `name` is the short name of the target, and `target` its entry of the card.
    """
    settings = ", ".join(f"{key}={value}" for key, value in target["settings"].items())
    yield f"{name:9} {settings} ({target['settings_from']})"
    if "left_out" in target:
        r2 = target["left_out"]["r2"]
        nmae = target["left_out"]["nmae"]
        yield f"          left out in turn: R2 {r2:.3f} %, nMAE {nmae:.2f} %"
    for remark in target["remarks"]:
        yield f"          warning: {remark}"


def _growth_line(grown: Mapping[str, Any]) -> str:
    """Return the line on the accuracy that `learn grow` has reached, from its entry of the card."""
    bounds = [f"{name} {bound:.3g} %" for name, bound in grown["bounds"].items()]
    met = "not met"
    if grown["met"]:
        met = "met"
    return (
        f"grown     to an nMAE of {grown['mark']:g} %: {met}, with {grown['rows']} rows; at"
        f" most {', '.join(bounds)}"
    )


def _interval_lines(card: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines on the calibration of intervals, and on their largest level.

    Cards of earlier versions may lack the calibration: no line is yielded then. For cards of 1.0.0
    whose intervals hold for the maps or databases of the training only (scheme "each"), there is no
    line on the largest level.
    """
    entry = card.get("calibration")
    if entry is None:
        return
    kinds = f"{entry['kind']}s"
    origin = ", each predicted without it"  # training rows calibrate
    if entry["database"]:  # another database calibrates
        origin = f" of {entry['database']}"
    valid_for = f"other {kinds} like these"
    if entry["scheme"] == "each":
        valid_for = (
            f"further surfaces of these {kinds}; for others, {FEWEST} or more are needed"
        )
    yield f"intervals calibrated by {calibrated_by(card)}{origin}: hold for {valid_for}"
    largest = entry.get("largest_level")
    if largest is None and entry["scheme"] != "each":
        # Cards of 1.0.0 do not state the largest level. K groups reach K / (K + 1), which is
        # rounded down to three digits.
        groups = entry["groups"]
        largest = math.floor(1000 * groups / (groups + 1)) / 1000
    if largest is not None:
        yield f"          {level_line(largest)}"


def level_line(largest: float) -> str:
    """Return the line on the largest level of intervals.

    Parameters
    ----------
    largest : float
        Largest level that the calibration reaches, between 0 and 1.

    Returns
    -------
    str
        The line. It is a warning if the largest level is below `USUAL_LEVEL`: answers then have
        intervals of the largest level by default.
    """
    if largest >= USUAL_LEVEL:
        return f"intervals hold up to a level of {100 * largest:g} %"
    return (
        f"warning: intervals hold up to a level of {100 * largest:g} % only, which questions get"
        f" unless they ask for less; {100 * USUAL_LEVEL:g} % take more surfaces or maps"
    )


def _training_text(card: Mapping[str, Any]) -> str:
    """Return patches, loads and bodies of the training in words."""
    # The card of a single database has the entries of this database itself.
    patches = [_patch_text(entry) for entry in card.get("databases", [card])]
    modulus = f"{card['modulus']:g}"
    if "layers" in card:
        modulus = span_text(TrainedLayers.of_card(card["layers"]).e_star)
    text = (
        f"{' and '.join(dict.fromkeys(patches))}, Delta {card['delta'][0]:.4g} to"
        f" {card['delta'][1]:.4g} um, E* {modulus} MPa"
    )
    if card["area_max"] is not None:
        text += f", areas to {card['area_max']:g} %"
    limits = card.get("hardness_ratio")
    if limits is not None:
        text += f", hardness {hardness_range_text(limits)} E*"
        if card.get("elastic"):
            text += ", and elastic bodies"
    boundary = card.get("boundary", "free")
    if boundary != "free":
        text += f", {boundary} boundary"
    if "layer" in card:
        text += f", a layer of {card['layer']}"
    return text


def _layer_line(card: Mapping[str, Any]) -> str:
    """Return the line on the layers that a surrogate holds for.

    The card is that of a surrogate of layers.
    """
    layers = TrainedLayers.of_card(card["layers"])
    columns = [name for name, _unit in card["columns"]]
    if LAYER_DEPTH not in columns:
        held = "this layer alone, at the lengths and moduli of the training"
        if card["features"] == SCENE:
            held = "the layers of the scene"
        return f"layers    holds for {held}"
    ratio = "a rigid base"
    if layers.base_ratio is not None:
        ratio = f"E* of the base {span_text(layers.base_ratio)} times that of the layer"
    return (
        f"layers    holds for {layers.kind.text}, {ratio}, at any scale of lengths and moduli"
        f" at which {LAYER_DEPTH} is in its range"
    )


def _patch_text(entry: Mapping[str, Any]) -> str:
    """Return nodes and sides [um] of a database in words, from its entry of the card."""
    nx, ny = entry["nodes"]
    x, y = entry["side"]
    if x == y:
        return f"{nx:g} x {ny:g} nodes, side {x:g} um"
    return f"{nx:g} x {ny:g} nodes, sides {x:g} x {y:g} um"


def _table_of_scores(card: Mapping[str, Any]) -> Table:
    """Return the table of scores and coverages on the test rows, one row for each target."""
    rows = []
    for name, target in card["targets"].items():
        target_scores = target["scores"]
        # the smallest and the largest true value of the test rows
        low, high = target["range"]
        # The nMSE has the unit of the target. It is shown for the area only, which is in percent.
        nmse = "-"
        if target["column"] == "area_percent":
            nmse = f"{target_scores['nmse']:.3f}"
        row = [name, str(target["unit"]), f"{low:.4g}", f"{high:.4g}", nmse]
        row += [f"{target_scores[score]:.3f}" for score in ("nmae", "nmaxe", "r2")]
        row += [f"{100 * entry['coverage']:.1f}" for entry in target["intervals"]]
        rows.append(row)
    headings_of_coverages = [f"in {100 * level:g} %" for level in LEVELS]
    return Table(
        title="Scores on the test rows [%], and shares of these inside their intervals [%]",
        names=["Target", "Unit"],
        numbers=["from", "to", "nMSE", "nMAE", "nMaxE", "R2", *headings_of_coverages],
        rows=rows,
    )


def _table_of_databases(card: Mapping[str, Any]) -> Table:
    """Return the table of the databases, with the scores of all targets on their test rows.

    The card has a list "databases", and so has the entry of each target. All these lists have the
    databases in one order.
    """
    headings = ["rows", "tested"]
    for name, target in card["targets"].items():
        error = "mean error"
        if target["unit"] != "1":  # Pure numbers have the unit "1".
            error = f"mean error [{target['unit']}]"
        headings += [
            f"{name}: nMAE [%]",
            f"{name}: {error}",
            f"{name}: in {100 * LEVELS[MIDDLE]:g} %",
        ]
    rows = []
    for place, database in enumerate(card["databases"]):
        scores_of_targets = [
            target["databases"][place] for target in card["targets"].values()
        ]
        # All targets have equal test rows, so that the first one states their number.
        number_tested = scores_of_targets[0]["rows"]
        row = [
            str(database["database"]),
            str(database["generator"]),
            f"{database['nodes'][0]:g} x {database['nodes'][1]:g}",
            str(database["rows"]),
            str(number_tested),
        ]
        for entry in scores_of_targets:
            nmae = "-"
            if np.isfinite(entry["nmae"]):
                nmae = f"{entry['nmae']:.3f}"
            row += [nmae, f"{entry['mae']:.3g}", f"{100 * entry['coverage']:.1f} %"]
        rows.append(row)
    return Table(
        title="Databases, and scores on their test rows",
        names=["Database", "Generator", "Nodes"],
        numbers=headings,
        rows=rows,
    )


def _table_of_ranges(card: Mapping[str, Any], low: Values, high: Values) -> Table:
    """Return the table of the inputs with their training ranges.

    `low` and `high` are the smallest and largest value of each feature, (d,). Features of a scene
    that are logarithms are shown as the numbers themselves.
    """
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
