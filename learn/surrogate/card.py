"""The model card: data, settings, scores, intervals and training ranges of a surrogate."""

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from gen.arrays import Indices, Values
from gen.runtime import VERSION
from gen.runtime.errors import InputError
from gen.runtime.terminal import printable
from gen.scene import Scene
from learn.comparison.folder import versions
from learn.dataset import Dataset, Request
from learn.features.sets import features_of, limits_of, modulus
from learn.metrics import magnitude, scores
from learn.models import MODELS
from learn.surrogate import flag
from learn.surrogate.calibration import FEWEST
from learn.surrogate.learnt import Learnt

if TYPE_CHECKING:
    from rich.table import Table

WIDTH = 120
"""Width of the tables without a terminal [characters]."""

LEVELS = (0.5, 0.9, 0.95)
"""Intervals whose coverage is reported."""

LICENCE = "BSD-3-Clause"


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
    scenes = [Scene.from_text(origin.scene) for origin in rows.origins]
    scene, limits = scenes[0], limits_of(scenes)
    boundary = scene.contact.boundary
    features = features_of(scenes, request.features, roots=request.roots, blocks=request.blocks)
    (model,) = request.models
    return {
        "title": f"{MODELS[model].title} for {', '.join(request.targets)}",
        "model": model,
        "features": features.name,
        **({"roots": True} if features.rooted else {}),
        **({"blocks": features.blocks} if features.blocks else {}),
        "columns": [list(pair) for pair in zip(features.columns, features.units, strict=True)],
        "normalisation": request.normalisation,
        "targets": judged,
        "scene": scene.text(),
        "nodes": list(scene.shape),
        "side": list(scene.sides),
        "spacing": list(scene.spacing),
        "modulus": modulus(scene),
        **({} if boundary == "free" else {"boundary": boundary}),
        **({} if limits is None else {"hardness_ratio": list(limits)}),
        **({"elastic": True} if features.elastic else {}),
        **({"databases": databases(rows)} if len(scenes) > 1 else {}),
        "delta": _ends(rows.described[train, 0]),
        "area_max": request.area_max,
        "rows": {
            **{name: int(size) for name, size in sizes.items()},
            **({"split_by": "tile"} if rows.by_tile else {}),
            "left_out": {why: int(number) for why, number in rows.dropped.items()},
        },
        "seed": request.seed,
        "database": rows.source["database"],
        "database_sha256": rows.source["database_sha256"],
        "versions": {"asperity": VERSION, **versions()},
        "licence": LICENCE,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def databases(rows: Dataset) -> list[dict[str, Any]]:
    """Return an entry of the card for each database: rows, generator and grid."""
    found = []
    for origin in rows.origins:
        scene = Scene.from_text(origin.scene)
        entry = {
            "database": origin.database,
            "sha256": origin.sha256,
            "rows": origin.rows,
            "generator": str(getattr(scene.surface, "generator", "")),
            "nodes": list(scene.shape),
            "side": list(scene.sides),
            "scene": origin.scene,
        }
        found.append(entry)
    return found


def judge(learnt: Learnt, rows: Dataset, test: Indices) -> dict[str, Any]:
    """Score the model of a target and its intervals on the test rows, in the target's unit."""
    raw, scale = learnt.raw(rows.inputs[test]), rows.scale[test]
    truth = rows.target[test]
    scored = vars(scores(truth * scale, learnt.within(raw * scale)))
    covered = []
    for level in LEVELS:
        share, *ends = learnt.calibration.coverage(raw, truth, level, rows.inputs[test])
        low, high = (learnt.within(end * scale) for end in ends)
        width = float(np.mean(high - low))
        covered.append({"level": level, "coverage": share, "mean_width": width})
    several = {} if len(rows.origins) == 1 else {"databases": _by_database(learnt, rows, test)}
    return {
        **several,
        "column": learnt.column,
        "unit": learnt.unit,
        "range": _ends(truth * scale),
        "scores": {name: float(value) for name, value in scored.items()},
        "intervals": covered,
        "ranges_of_prediction": int(learnt.calibration.borders.size + 1),
    }


def _by_database(learnt: Learnt, rows: Dataset, test: Indices) -> list[dict[str, Any]]:
    """Score the model on the test rows of each database; NaN where there are none.

    The nMAE is NaN, too, where a target is 0 in all of them; the mean error says more there.
    """
    found = []
    for number in range(len(rows.origins)):
        mine = test[rows.database[test] == number]
        nmae = mae = covered = float("nan")
        if mine.size:
            raw, truth, scale = learnt.raw(rows.inputs[mine]), rows.target[mine], rows.scale[mine]
            error = np.abs(learnt.within(raw * scale) - truth * scale)
            mae, size = float(error.mean()), magnitude(truth * scale)
            nmae = 100 * mae / size if size else nmae
            covered, *_ = learnt.calibration.coverage(raw, truth, LEVELS[1], rows.inputs[mine])
        found.append({"rows": int(mine.size), "nmae": nmae, "mae": mae, "coverage": covered})
    return found


def left_out(learnt: Learnt, rows: Dataset, crossed: Values) -> dict[str, float]:
    """Score predictions of training rows, (n,), by models that have not seen their groups [%].

    The predictions are over their scale.
    """
    predicted = learnt.within(crossed * rows.scale)
    found = scores(rows.target * rows.scale, predicted)
    return {name: float(value) for name, value in vars(found).items()}


def lines(card: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of a card, without its tables."""
    yield f"{card['title']}, {card['features']} features, normalised: {card['normalisation']}"
    rows, by = card["rows"], card["rows"].get("split_by", "surface")
    left_out = sum(rows["left_out"].values())
    yield (
        f"rows      {rows['train']} trained, {rows['calibration']} calibrated, {rows['test']}"
        f" tested (split by {by}, seed {card['seed']}); {left_out} left out"
    )
    limit = "" if card["area_max"] is None else f", areas to {card['area_max']:g} %"
    yield (
        f"trained   on {_patch(card)}, Delta {card['delta'][0]:.4g} to {card['delta'][1]:.4g} um,"
        f" E* {card['modulus']:g} MPa{limit}{_hardness(card)}{_boundary(card)}"
    )
    for name, target in card["targets"].items():
        settings = ", ".join(f"{key}={value}" for key, value in target["settings"].items())
        yield f"{name:9} {settings} ({target['settings_from']})"
        if "left_out" in target:
            r2, nmae = target["left_out"]["r2"], target["left_out"]["nmae"]
            yield f"          left out in turn: R2 {r2:.3f} %, nMAE {nmae:.2f} %"
        for remark in target["remarks"]:
            yield f"          warning: {remark}"
    if said := _calibration(card):
        yield f"intervals {said}"
    if "grown" in card:
        yield f"grown     {_grown(card['grown'])}"
    for entry in card.get("databases", []):
        yield f"data      {entry['database']}, sha256 {entry['sha256'][:16]}"
        yield f"scene     {entry['scene']}"
    if "databases" not in card:
        yield f"data      {card['database']}, sha256 {card['database_sha256'][:16]}"
        yield f"scene     {card['scene']}"
    named = ", ".join(f"{name} {number}" for name, number in card["versions"].items() if number)
    yield f"versions  {named}"
    yield f"made      {card['made']}, licence {card['licence']}"


def _calibration(card: Mapping[str, Any]) -> str:
    """Say by what intervals are calibrated and what they hold for; "" for held-out rows."""
    if "calibration" not in card:
        return ""
    entry = card["calibration"]
    groups, kinds = entry["groups"], f"{entry['kind']}s"
    origin = f" of {entry['database']}" if entry["database"] else ""
    if entry["scheme"] == "ranges":
        return f"calibrated by {card['rows']['calibration']} rows{origin}: hold for rows like these"
    if entry["scheme"] == "each":
        return (
            f"calibrated on each of {groups} {kinds}{origin}: hold for further surfaces of these"
            f" {kinds}; for others, {FEWEST} {kinds} or more are needed"
        )
    how = "" if entry["database"] else ", each predicted without it"
    return (
        f"calibrated by whole {kinds}{origin} ({groups} of them{how}): hold for other {kinds} like"
        f" these, up to {100 * groups / (groups + 1):.1f} %"
    )


def _grown(record: dict[str, Any]) -> str:
    """State the accuracy that a growth aimed at, and the accuracy that it reached."""
    bounds = ", ".join(f"{name} {bound:.3g} %" for name, bound in record["bounds"].items())
    met = "met" if record["met"] else "not met"
    return (
        f"to an nMAE of {record['mark']:g} %: {met}, with {record['rows']} rows; at most {bounds}"
    )


def _patch(card: Mapping[str, Any]) -> str:
    """Describe nodes and sides of the training's patches, as many as there are."""

    def patch(entry: Mapping[str, Any]) -> str:
        (nx, ny), (x, y) = flag.pair(entry, "nodes"), flag.pair(entry, "side")
        sides = f"side {x:g} um" if x == y else f"sides {x:g} x {y:g} um"
        return f"{nx:g} x {ny:g} nodes, {sides}"

    return " and ".join(dict.fromkeys(patch(entry) for entry in card.get("databases", [card])))


def _hardness(card: Mapping[str, Any]) -> str:
    """Describe the hardness of the training; "" for elastic bodies."""
    limits = card.get("hardness_ratio")
    also = ", and elastic bodies" if card.get("elastic") else ""
    return "" if limits is None else f", hardness {flag.between(limits)} E*{also}"


def _boundary(card: Mapping[str, Any]) -> str:
    """Describe the boundary of patches without edges; "" for free ones."""
    boundary = flag.boundary_of(card)
    return "" if boundary == "free" else f", {boundary} boundary"


def show(card: Mapping[str, Any], low: Values, high: Values) -> None:
    """Print a card with its tables, with the training ranges of the features, each end (d,).

    InputError is raised if an entry of the card is missing, so that the file is not from `learn
    fit`.
    """
    from gen.runtime.terminal import echo, print_table

    try:
        texts = list(lines(card))
        tables = [_scores(card), _intervals(card), _ranges(card, low, high)]
        if "databases" in card:
            tables.insert(0, _databases(card))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        fault = printable(f"{type(error).__name__}: {error}")
        raise InputError(f"the surrogate's card is not whole ({fault}): fit it anew") from None
    for text in texts:
        echo(text)
    for table in tables:
        print_table(table, WIDTH)


def _scores(card: Mapping[str, Any]) -> "Table":
    table = _table("Scores on the test rows [%]", "Target", "Unit")
    for column in ("from", "to", "nMSE", "nMAE", "nMaxE", "R2"):
        table.add_column(column, justify="right")
    for name, target in card["targets"].items():
        scores, (low, high) = target["scores"], target["range"]
        nmse = f"{scores['nmse']:.3f}" if target["column"] == "area_percent" else "-"
        others = (f"{scores[score]:.3f}" for score in ("nmae", "nmaxe", "r2"))
        ends = f"{low:.4g}", f"{high:.4g}"
        table.add_row(_plain(name), _plain(target["unit"]), *ends, nmse, *others)
    return table


def _databases(card: Mapping[str, Any]) -> "Table":
    """Return the table of the databases, with scores on the test rows of each."""
    table = _table("Databases, and scores on their test rows", "Database", "Generator", "Nodes")
    for column in ("rows", "tested"):
        table.add_column(column, justify="right")
    targets = card["targets"]
    for name in targets:
        unit = _plain(targets[name]["unit"])
        table.add_column(f"{_plain(name)}: nMAE [%]", justify="right")
        table.add_column(f"mean error [{unit}]".replace("[1]", "").strip(), justify="right")
        table.add_column(f"in {LEVELS[1]:.0%}", justify="right")
    for place, entry in enumerate(card["databases"]):
        judged = [target["databases"][place] for target in targets.values()]
        nodes = f"{entry['nodes'][0]:g} x {entry['nodes'][1]:g}"
        cells = [_plain(entry["database"]), _plain(entry["generator"]), nodes]
        cells += [f"{entry['rows']}", f"{judged[0]['rows']}"]
        for each in judged:
            known = np.isfinite(each["nmae"])  # older files say inf where a target is always 0
            cells.append(f"{each['nmae']:.3f}" if known else "-")
            cells.append(f"{each['mae']:.3g}" if "mae" in each else "-")
            cells.append(f"{100 * each['coverage']:.1f} %")
        table.add_row(*cells)
    return table


def _intervals(card: Mapping[str, Any]) -> "Table":
    table = _table("Conformal intervals on the test rows", "Target")
    for column in ("wanted", "covered", "mean width"):
        table.add_column(column, justify="right")
    for name, target in card["targets"].items():
        for each in target["intervals"]:
            wanted, covered = f"{100 * each['level']:.0f} %", f"{100 * each['coverage']:.1f} %"
            width = f"{each['mean_width']:.4g} {target['unit']}"
            table.add_row(_plain(name), wanted, covered, _plain(width))
    return table


def _ranges(card: Mapping[str, Any], low: Values, high: Values) -> "Table":
    table = _table("Inputs and their training ranges", "Input", "Unit")
    for column in ("from", "to"):
        table.add_column(column, justify="right")
    for (name, unit), least, most in zip(card["columns"], low, high, strict=True):
        table.add_row(_plain(name), _plain(unit), f"{least:.5g}", f"{most:.5g}")
    return table


def _table(title: str, *names: str) -> "Table":
    from rich.table import Table

    table = Table(title=title)
    for name in names:
        table.add_column(name)
    return table


def _plain(text: Any) -> str:
    """Return a text of the file as a cell, without markup and control characters."""
    return printable(str(text))


def _ends(values: Values) -> list[float]:
    """Return the least and the largest of some values."""
    return [float(values.min()), float(values.max())]
