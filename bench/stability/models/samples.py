"""Ordinary rows of the paper's kind, on a small grid, and the changes that spoil them."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

import bem
from gen.arrays import Values
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.scene import Scene, load
from gen.statistics import describe
from learn.dataset import Dataset
from learn.features import chosen
from learn.features.sets import build, target_scale
from learn.pooling import Origin

Change = Callable[[Dataset], Dataset]

ROWS = 90
NODES = 33
SEEN = 60  # the first rows train; of the others 10 calibrate and 20 test

CALIBRATING = 10


def scene() -> Scene:
    """The paper preset on the small grid."""
    text = f"samples = {ROWS}\n[surface]\nnodes = {NODES}\n"
    return Scene.parse(text, "the cases' scene")


@lru_cache(maxsize=1)
def solved() -> tuple[Values, Values]:
    """Delta and the 22 statistics (n, 23), and force and area (n, 2) [uN, %]."""
    wanted, plan = scene(), parameters(load("paper"), 0, ROWS)
    inputs, targets = [], []
    for row, delta in enumerate(plan.delta.tolist()):
        heights = surface_of(wanted, plan, row)
        inputs.append([delta, *describe(heights, wanted.spacing).values.values()])
        contact = bem.solve(heights, wanted.sides[0], delta)
        targets.append([contact.force, contact.area_percent])
    return np.array(inputs), np.array(targets)


@lru_cache(maxsize=8)
def ordinary(features: str = "paper", target: str = "area_percent") -> Dataset:
    """The rows as a dataset of paper or dimensionless features; the target is area or force."""
    described, targets = solved()
    wanted, side = chosen(features), scene().sides[0]
    statistics, delta = described[:, 1:], described[:, 0]
    scale = target_scale(wanted, target, statistics, delta, side, 1.0)
    return Dataset(
        inputs=build(wanted, statistics, delta, side),
        target=targets[:, int(target == "area_percent")] / scale,
        rows=np.arange(ROWS),
        groups=np.arange(ROWS),
        database=np.zeros(ROWS, dtype=np.int64),
        population=np.zeros(ROWS, dtype=np.int64),
        names=wanted.columns,
        target_name=target,
        unit="%" if target == "area_percent" else "uN",
        dropped={},
        source={"database": "the cases' rows", "database_sha256": "", "scene": scene().text()},
        described=described,
        origins=(Origin("the cases' rows", "", scene().text(), ROWS),),
        scale=scale,
        features=features,
    )


def altered(part: str, where: Any, to: float | None = None, factor: float = 1.0) -> Change:
    """Set some of the rows' `inputs` or `target` to a number, or multiply them.

    `where` is any index of the array.
    """

    def change(rows: Dataset) -> Dataset:
        values = getattr(rows, part).copy()
        values[where] = values[where] * factor if to is None else to
        return replace(rows, **{part: values})

    return change


def collinear(rows: Dataset) -> Dataset:
    """One input is twice another, one the sum of two."""
    inputs = rows.inputs.copy()
    inputs[:, 1], inputs[:, 2] = 2 * inputs[:, 3], inputs[:, 3] + inputs[:, 0]
    return replace(rows, inputs=inputs)


def doubled(rows: Dataset) -> Dataset:
    """The first half of the training rows twice."""
    return rows.at(np.r_[: SEEN // 2, : SEEN // 2, SEEN : rows.size])


def contradicting(rows: Dataset) -> Dataset:
    """The first half twice, with targets that are 10 % apart."""
    return altered("target", slice(SEEN // 2), factor=1.1)(doubled(rows))


CONSTANT_COLUMN = altered("inputs", np.s_[:, 5], 0.25)
DOMINANT_COLUMN = altered("inputs", np.s_[:, 20], factor=1e12)  # that a row's length is made of
