"""The model card: data, settings, scores, intervals and training ranges of a surrogate."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices, Values
from gen.runtime import VERSION
from gen.runtime.errors import InputError
from gen.runtime.terminal import echo, print_columns, printable
from learn.database_rows import Dataset
from learn.dataset import Request
from learn.features.scene import SCENE, plain, shown
from learn.features.sets import limits_of
from learn.metrics import magnitude, no_better, scores
from learn.models import EVERY, versions
from learn.surrogate.calibration import FEWEST
from learn.surrogate.interval import USUAL_LEVEL, calibrated_by
from learn.surrogate.learnt import Fit, Learnt
from learn.surrogate.training import between

# title, headings of columns of names and of columns of numbers, and rows
Table = tuple[str, list[str], list[str], Sequence[Sequence[object]]]

LEVELS = (0.5, 0.9, 0.95)  # intervals whose coverage is reported
# what the intervals of one model and set of features hold (`bench/results/coverage`)
MEASURED = (
    "          measured on 27 kinds of surfaces that were not trained on (bench coverage): 94 % of"
    " the rows without a flag lie in their 90 % interval, of the worst kind 86 %"
)


def make(
    request: Request,
    rows: Dataset,
    train: Indices,
    sizes: Mapping[str, int],
    judged: dict[str, dict[str, Any]],
) -> dict[str, Any]:
    """Assemble the card, of numbers, texts, lists and dictionaries only.

    `train` are positions among the usable rows; `sizes` are the numbers of rows that "train",
    "calibration" and "test" have; `judged` are the entries of the targets.
    """
    scene, limits = (
        rows.origins[0].scene,
        limits_of([origin.scene for origin in rows.origins]),
    )
    boundary = scene.contact.boundary
    features, (model,) = rows.features, request.models
    databases = [
        {
            "database": origin.database,
            "sha256": origin.sha256,
            "rows": origin.rows,
            "generator": str(getattr(origin.scene.surface, "generator", "")),
            "nodes": list(origin.scene.grid.shape),
            "side": list(origin.scene.grid.sides),
            "scene": origin.scene.text(),
        }
        for origin in rows.origins
    ]
    sometimes = {
        "roots": features.rooted,
        "blocks": features.blocks,
        "boundary": boundary if boundary != "free" else "",
        "hardness_ratio": None if limits is None else list(limits),
        "elastic": features.elastic,
        "load": features.load if features.of_scene or features.load != "delta" else "",
        "databases": databases if len(databases) > 1 else [],
    }
    return {
        "title": f"{EVERY[model].title} for {', '.join(request.targets)}",
        "model": model,
        "features": features.name,
        "columns": [
            list(pair) for pair in zip(features.columns, features.units, strict=True)
        ],
        "normalisation": request.normalisation,
        "targets": judged,
        **{name: databases[0][name] for name in ("scene", "nodes", "side")},
        "spacing": list(scene.grid.spacing),
        "modulus": scene.contact.e_star,
        **{name: value for name, value in sometimes.items() if value},
        "delta": np.quantile(rows.described[train, 0], (0, 1)).tolist(),
        "area_max": request.area_max,
        "rows": {
            **{name: int(size) for name, size in sizes.items()},
            **({"split_by": "tile"} if rows.by_tile else {}),
            "left_out": {why: int(number) for why, number in rows.dropped.items()},
        },
        "seed": request.seed,
        "database": rows.name,
        "database_sha256": rows.sha256,
        "versions": {"asperity": VERSION, **versions()},
        "licence": "BSD-3-Clause",
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def judge(fitted: Fit, rows: Dataset, test: Indices) -> dict[str, Any]:
    """Return the entry of a target: its model and intervals judged on the test rows, and its fit.

    Scores are in percent, the rest is in the target's unit.
    """
    learnt, tested = fitted.learnt, rows.at(test)
    raw, scale, truth = learnt.raw(tested.inputs), tested.scale, tested.target
    covered, held = [], []
    for level in LEVELS:
        low, high = learnt.calibration.ends(raw, level, tested.inputs)
        held.append((low <= truth) & (truth <= high))
        width = np.clip(high * scale, *learnt.bounds) - np.clip(
            low * scale, *learnt.bounds
        )
        own = {"coverage": float(held[-1].mean()), "mean_width": float(width.mean())}
        covered.append({"level": level, **own})
    found = scores_of(learnt, tested, raw)
    several = len(rows.origins) > 1
    return {
        **({"databases": _by_database(learnt, tested, raw, held[1])} if several else {}),
        "column": learnt.column,
        "unit": learnt.unit,
        "range": np.quantile(truth * scale, (0, 1)).tolist(),
        "scores": found,
        "intervals": covered,
        "settings": {
            name: str(each) for name, each in sorted(fitted.settings.values.items())
        },
        "settings_from": fitted.settings.origin,
        "fit_seconds": fitted.fitting,
        "remarks": [*fitted.remarks, *filter(None, [no_better(found["r2"])])],
    }


def scores_of(learnt: Learnt, rows: Dataset, raw: Values) -> dict[str, float]:
    """Return the scores of predictions of rows over their scale, (n,) [%]."""
    return {
        **vars(
            scores(rows.target * rows.scale, np.clip(raw * rows.scale, *learnt.bounds))
        )
    }


def _by_database(
    learnt: Learnt, tested: Dataset, raw: Values, held: NDArray[np.bool_]
) -> list[dict[str, Any]]:
    """Score the model on the test rows of each database; NaN where there are none.

    The nMAE is NaN, too, where a target is 0 in all of them; the mean error says more there.
    `held` tells of each row whether its interval of `LEVELS[1]` holds the truth.
    """
    found, truth = [], tested.target * tested.scale
    errors = np.abs(np.clip(raw * tested.scale, *learnt.bounds) - truth)
    for number in range(len(tested.origins)):
        mine = tested.database == number
        nmae = mae = covered = float("nan")
        if mine.any():
            mae, covered = float(errors[mine].mean()), float(held[mine].mean())
            size = magnitude(truth[mine])
            nmae = 100 * mae / size if size else nmae
        found.append(
            {"rows": int(mine.sum()), "nmae": nmae, "mae": mae, "coverage": covered}
        )
    return found


def show(card: Mapping[str, Any], low: Values, high: Values) -> None:
    """Print a card with its tables, with the training ranges of the features, each end (d,)."""
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
    for title, names, numbers, rows in tables:
        echo("")
        echo(title)
        print_columns(
            [[*map(str, row)] for row in rows], [*names, *numbers], right=numbers
        )


def lines(card: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of a card, without its tables."""
    yield f"{card['title']}, {card['features']} features, normalised: {card['normalisation']}"
    rows, by = card["rows"], card["rows"].get("split_by", "surface")
    yield (
        f"rows      {rows['train']} trained, {rows['calibration']} calibrated, {rows['test']}"
        f" tested (split by {by}, seed {card['seed']}); {sum(rows['left_out'].values())} left out"
    )
    yield f"trained   on {_training(card)}"
    for name, target in card["targets"].items():
        settings = ", ".join(
            f"{key}={value}" for key, value in target["settings"].items()
        )
        yield f"{name:9} {settings} ({target['settings_from']})"
        if "left_out" in target:
            r2, nmae = target["left_out"]["r2"], target["left_out"]["nmae"]
            yield f"          left out in turn: R2 {r2:.3f} %, nMAE {nmae:.2f} %"
        for remark in target["remarks"]:
            yield f"          warning: {remark}"
    yield from _interval_lines(card)
    if (card["model"], card["features"]) == ("kernel-ridge", "hybrid"):
        yield MEASURED
    if "grown" in card:
        grown = card["grown"]
        bounds = ", ".join(
            f"{name} {bound:.3g} %" for name, bound in grown["bounds"].items()
        )
        met = "met" if grown["met"] else "not met"
        yield (
            f"grown     to an nMAE of {grown['mark']:g} %: {met}, with {grown['rows']} rows; at"
            f" most {bounds}"
        )
    alone = {**card, "sha256": card["database_sha256"]}
    for entry in card.get("databases", [alone]):
        yield f"data      {entry['database']}, sha256 {entry['sha256'][:16]}"
        yield f"scene     {entry['scene']}"
    named = ", ".join(
        f"{name} {number}" for name, number in card["versions"].items() if number
    )
    yield f"versions  {named}"
    yield f"made      {card['made']}, licence {card['licence']}"


def _interval_lines(card: Mapping[str, Any]) -> Iterator[str]:
    """Yield what calibrates intervals, what they hold for, and their largest level."""
    entry = card.get("calibration")
    if entry is None:
        return
    groups, kinds = entry["groups"], f"{entry['kind']}s"
    how = (
        f" of {entry['database']}" if entry["database"] else ", each predicted without it"
    )
    hold = f"other {kinds} like these"
    if entry["scheme"] == "each":
        hold = (
            f"further surfaces of these {kinds}; for others, {FEWEST} or more are needed"
        )
    yield f"intervals calibrated by {calibrated_by(card)}{how}: hold for {hold}"
    largest = entry.get("largest_level")
    if largest is None and entry["scheme"] != "each":  # a file of 1.0.0
        largest = math.floor(1000 * groups / (groups + 1)) / 1000
    if largest is not None:
        yield f"          {level_line(largest)}"


def level_line(largest: float) -> str:
    """Tell the largest level of intervals, and which one questions get by default."""
    if largest >= USUAL_LEVEL:
        return f"intervals hold up to a level of {100 * largest:g} %"
    return (
        f"warning: intervals hold up to a level of {100 * largest:g} % only, which questions get"
        f" unless they ask for less; {100 * USUAL_LEVEL:g} % take more surfaces or maps"
    )


def _training(card: Mapping[str, Any]) -> str:
    """Describe patches, loads and bodies of the training."""
    patches = []
    for entry in card.get("databases", [card]):
        (nx, ny), (x, y) = entry["nodes"], entry["side"]
        sides = f"side {x:g} um" if x == y else f"sides {x:g} x {y:g} um"
        patches.append(f"{nx:g} x {ny:g} nodes, {sides}")
    text = (
        f"{' and '.join(dict.fromkeys(patches))}, Delta {card['delta'][0]:.4g} to"
        f" {card['delta'][1]:.4g} um, E* {card['modulus']:g} MPa"
    )
    if card["area_max"] is not None:
        text += f", areas to {card['area_max']:g} %"
    if (limits := card.get("hardness_ratio")) is not None:
        also = ", and elastic bodies" if card.get("elastic") else ""
        text += f", hardness {between(limits)} E*{also}"
    boundary = card.get("boundary", "free")
    return text if boundary == "free" else f"{text}, {boundary} boundary"


def _scores(card: Mapping[str, Any]) -> Table:
    rows = []
    for name, target in card["targets"].items():
        scores, (low, high) = target["scores"], target["range"]
        nmse = f"{scores['nmse']:.3f}" if target["column"] == "area_percent" else "-"
        others = [f"{scores[score]:.3f}" for score in ("nmae", "nmaxe", "r2")]
        others += [f"{100 * each['coverage']:.1f}" for each in target["intervals"]]
        rows.append((name, target["unit"], f"{low:.4g}", f"{high:.4g}", nmse, *others))
    title = "Scores on the test rows [%], and shares of these inside their intervals [%]"
    inside = [f"in {100 * level:g} %" for level in LEVELS]
    return (
        title,
        ["Target", "Unit"],
        ["from", "to", "nMSE", "nMAE", "nMaxE", "R2", *inside],
        rows,
    )


def _databases(card: Mapping[str, Any]) -> Table:
    """Return the table of the databases, with scores on the test rows of each."""
    headings = ["rows", "tested"]
    for name, target in card["targets"].items():
        error = (
            "mean error" if target["unit"] == "1" else f"mean error [{target['unit']}]"
        )
        headings += [
            f"{name}: {each}" for each in ("nMAE [%]", error, f"in {100 * LEVELS[1]:g} %")
        ]
    rows = []
    for place, entry in enumerate(card["databases"]):
        judged = [target["databases"][place] for target in card["targets"].values()]
        nodes = f"{entry['nodes'][0]:g} x {entry['nodes'][1]:g}"
        row = [
            entry["database"],
            entry["generator"],
            nodes,
            entry["rows"],
            judged[0]["rows"],
        ]
        for each in judged:
            nmae = f"{each['nmae']:.3f}" if np.isfinite(each["nmae"]) else "-"
            row += [nmae, f"{each['mae']:.3g}", f"{100 * each['coverage']:.1f} %"]
        rows.append(row)
    title = "Databases, and scores on their test rows"
    return title, ["Database", "Generator", "Nodes"], headings, rows


def _ranges(card: Mapping[str, Any], low: Values, high: Values) -> Table:
    if card["features"] == SCENE:
        names = [name for name, _ in card["columns"]]
        low, high = shown(names, low), shown(names, high)
        card = {
            **card,
            "columns": [(plain(name), unit) for name, unit in card["columns"]],
        }
    columns = zip(card["columns"], low, high, strict=True)
    rows = [
        (name, unit, f"{least:.5g}", f"{most:.5g}")
        for (name, unit), least, most in columns
    ]
    return "Inputs and their training ranges", ["Input", "Unit"], ["from", "to"], rows
