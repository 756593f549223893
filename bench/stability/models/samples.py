"""Ordinary rows of the paper's kind, on a small grid, and what spoils them."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

import bem
from gen.generation.plan import parameters, surface_random
from gen.scene import Scene, load
from gen.statistics import describe
from gen.surface import generate
from learn.dataset import Dataset
from learn.features import chosen
from learn.features.sets import build, target_scale

Values = NDArray[np.float64]
Change = Callable[[Dataset], Dataset]

ROWS = 90
NODES = 33
SEEN = 60
"""The first rows train; of the others 10 calibrate and 20 test."""

CALIBRATING = 10


def scene() -> Scene:
    """The paper preset on the small grid."""
    text = f"samples = {ROWS}\n[surface]\nnodes = {NODES}\n"
    return Scene.parse(text, "the cases' scene")


@lru_cache(maxsize=1)
def solved() -> tuple[Values, Values]:
    """Delta and the 22 statistics (n, 23), and force and area (n, 2) [uN, %]."""
    wanted = scene()
    rows = parameters(load("paper"), 0, ROWS)
    inputs, targets = [], []
    for row in range(ROWS):
        heights = generate(
            wanted.surface.generator,
            NODES,
            float(rows.hurst[row]),
            float(rows.sigma0[row]),
            surface_random(wanted, row),
        )
        delta = float(rows.delta[row])
        inputs.append([delta, *describe(heights, wanted.spacing).values.values()])
        contact = bem.solve(heights, wanted.surface.side, delta)
        targets.append([contact.force, contact.area_percent])
    return np.array(inputs), np.array(targets)


@lru_cache(maxsize=8)
def ordinary(features: str = "paper", target: str = "area_percent") -> Dataset:
    """The rows as a dataset.

    Parameters
    ----------
    features : paper or dimensionless
    target : area_percent or force
    """
    described, targets = solved()
    wanted, side = chosen(features), scene().surface.side
    statistics, delta = described[:, 1:], described[:, 0]
    scale = target_scale(wanted, target, statistics, delta, side, 1.0)
    return Dataset(
        inputs=build(wanted, statistics, delta, side),
        target=targets[:, int(target == "area_percent")] / scale,
        rows=np.arange(ROWS),
        groups=np.arange(ROWS),
        names=wanted.columns,
        target_name=target,
        unit="%" if target == "area_percent" else "uN",
        dropped={},
        source={
            "database": "the cases' rows",
            "database_sha256": "",
            "scene": scene().text(),
        },
        described=described,
        scale=scale,
        features=features,
    )


def with_inputs(change: Callable[[Values], Values]) -> Change:
    """Other inputs for all rows."""
    return lambda rows: replace(rows, inputs=change(rows.inputs.copy()))


def with_target(change: Callable[[Values], Values]) -> Change:
    """Another target for all rows."""
    return lambda rows: replace(rows, target=change(rows.target.copy()))


def unchanged(rows: Dataset) -> Dataset:
    """The rows as they are."""
    return rows
