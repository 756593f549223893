"""How far is a surface pressed in, if so much of it is seen to touch?

    python examples/identification.py area.surrogate surface.npy --side 1000 --area 5 --level 0.9

The displacements at which the surrogate's interval holds the measured area are an interval for
Delta, of the same coverage: it fails when the interval for the area fails, at the true Delta.
"""

import argparse

import numpy as np

from gen.runtime.command_line import run_script
from learn import Surrogate

POINTS = 400
"""Displacements tried: one call, since the features of a surface are computed once."""


def sides(text: str) -> tuple[float, float]:
    """Read one length, or one for each axis [um]."""
    x, _, y = text.partition(",")
    return float(x), float(y or x)


def main(arguments: list[str]) -> tuple[float, float, float]:
    """Return Delta and the ends of its interval [um]."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("surrogate", help="made by asperity learn fit")
    parser.add_argument("surface", help="heights in um (.npy)")
    parser.add_argument(
        "--side", type=sides, required=True, help="scan length, or X,Y [um]"
    )
    parser.add_argument("--area", type=float, required=True, help="measured area [%%]")
    parser.add_argument(
        "--hardness", type=float, help="[MPa], if the training has several"
    )
    parser.add_argument(
        "--level", type=float, help="of the interval; 0.9, or what it reaches"
    )
    parser.add_argument("--small", action="store_true", help="60 displacements")
    given = parser.parse_args(arguments)
    surrogate = Surrogate.load(given.surrogate)
    if "area" not in surrogate.learnt:
        parser.error(
            f"{given.surrogate}: predicts {', '.join(surrogate.learnt)}, not the area"
        )
    pressed = surrogate.for_surface(np.load(given.surface), given.side, given.surface)
    level = given.level or min(0.9, surrogate.largest_level)
    deltas = np.linspace(*surrogate.card["delta"], 60 if given.small else POINTS)
    answer = pressed.predict(deltas, hardness=given.hardness, level=level)
    # The area grows with Delta; a surrogate need not know that.
    areas = np.maximum.accumulate(answer.area)
    if not areas[0] <= given.area <= areas[-1]:
        parser.error(
            f"--area {given.area:g}: from Delta = {deltas[0]:.3g} to {deltas[-1]:.3g} um, which the"
            f" surrogate was trained on, it is {areas[0]:.3g} to {areas[-1]:.3g} %"
        )
    delta = float(np.interp(given.area, areas, deltas))
    possible = deltas[
        (answer.low["area"] <= given.area) & (given.area <= answer.high["area"])
    ]
    low, high = (possible[0], possible[-1]) if possible.size else (delta, delta)
    interval = f"{level:.0%} interval {low:.4g} to {high:.4g} um"
    print(
        f"Delta = {delta:.4g} um; {interval if low < high else 'no interval holds this area'}"
    )
    if low == deltas[0] or high == deltas[-1]:
        print("the interval ends with the training range: Delta may lie beyond")
    if answer.reasons[0]:
        print(f"not as trained: {answer.reasons[0]}")
    return delta, float(low), float(high)


if __name__ == "__main__":
    run_script(main)
