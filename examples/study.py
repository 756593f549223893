"""How does the contact area depend on a parameter of the surfaces, as H, and on Delta?

    python examples/study.py area.surrogate --parameter hurst --csv study.csv

Each surface's features are computed once for all displacements; the same noise at every value of
the parameter takes chance out of the comparison. Other parameters are in the middle of their range.
"""

import argparse

import numpy as np

from gen.distribution import is_drawn, limits, quantiles
from gen.generation.sample import surface_numbered
from gen.runtime.command_line import run_script
from gen.runtime.user_code import TRUSTED
from gen.scene import Scene
from learn import Surrogate


def main(arguments: list[str]) -> np.ndarray:
    """Return means of the first target, areas [%] as a rule, (values, displacements)."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("surrogate", help="made by asperity learn fit")
    parser.add_argument(
        "--parameter", metavar="NAME", help="the first one drawn if left out"
    )
    parser.add_argument("--surfaces", type=int, default=50, help="for each value")
    parser.add_argument(
        "--trust", action="store_true", help="run the scene's own function"
    )
    parser.add_argument("--small", action="store_true", help="3 surfaces, 3 x 4 points")
    parser.add_argument("--csv", metavar="FILE", help="the table as a file")
    parser.add_argument("--plot", metavar="FILE", help="curves")
    given = parser.parse_args(arguments)
    TRUSTED.set(given.trust)
    surrogate = Surrogate.load(given.surrogate)
    (target, about), *_ = surrogate.card["targets"].items()
    scene, label = (
        Scene.from_text(surrogate.card["scene"]),
        f"mean {target} [{about['unit']}]",
    )
    drawn = {
        name: each for name, each in scene.drawn_parameters.items() if is_drawn(each)
    }
    name = given.parameter or next(iter(drawn), None)
    if name not in drawn:
        parser.error(f"--parameter: the scene draws {', '.join(drawn) or 'none'}")
    middle = {each: quantiles(drawn[each], np.array([0.5]))[0] for each in drawn}
    ratios = surrogate.hardness_limits
    hardness = None if ratios is None else np.sqrt(np.prod(ratios)) * surrogate.modulus
    steps = np.linspace(*limits(drawn[name]), 3 if given.small else 7)
    deltas = np.linspace(*surrogate.card["delta"], 4 if given.small else 20)
    found = np.zeros((steps.size, deltas.size))
    surfaces = range(3 if given.small else given.surfaces)
    for row, value in enumerate(steps.tolist()):
        asked = scene.with_parameters(middle | {name: value})
        for number in surfaces:
            pressed = surrogate.for_surface(surface_numbered(asked, number), asked.sides)
            answer = pressed.predict(deltas, hardness=hardness)
            found[row] += answer.values[target] / len(surfaces)
    print(f"{label:20} Delta [um] " + " ".join(f"{delta:6.3g}" for delta in deltas))
    for value, row in zip(steps, found, strict=True):
        print(f"{name:>20} = {value:8.3g} " + " ".join(f"{each:6.3g}" for each in row))
    if given.csv:
        header = f"{name}," + ",".join(f"delta {delta:.4g} um" for delta in deltas)
        np.savetxt(
            given.csv, np.c_[steps, found], "%.6g", ",", header=header, comments=""
        )
    if given.plot:
        from matplotlib.figure import Figure

        axis = Figure(figsize=(5, 3.5), layout="constrained").subplots()
        axis.plot(deltas, found.T, label=[f"{name} = {value:.3g}" for value in steps])
        axis.set(xlabel="Delta [um]", ylabel=label)
        axis.legend()
        axis.figure.savefig(given.plot)
    return found


if __name__ == "__main__":
    run_script(main)
