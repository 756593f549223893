"""How much does the contact area scatter over a population of surfaces?

    python examples/propagation.py area.surrogate --delta 15 --surfaces 1000

Surfaces differ by chance alone: their parameters are the middle of what the scene draws, or those
of --set. Each is asked once; a few are solved too, to see whether the answers can be trusted.
"""

import argparse
from contextlib import suppress

import numpy as np

from gen.distribution import quantiles
from gen.generation.completion import UNSOLVED
from gen.generation.sample import solve_contact, surface_numbered
from gen.runtime.command_line import run_script
from gen.runtime.user_code import TRUSTED
from gen.scene import Scene
from learn import Surrogate


def main(arguments: list[str]) -> np.ndarray:
    """Return the values of the first target, areas [%] as a rule."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("surrogate", help="made by asperity learn fit")
    parser.add_argument(
        "--delta", type=float, help="[um]; the middle of the training if left out"
    )
    parser.add_argument(
        "--set", nargs=2, metavar=("NAME", "VALUE"), action="append", default=[]
    )
    parser.add_argument("--surfaces", type=int, default=1000)
    parser.add_argument(
        "--trust", action="store_true", help="run the scene's own function"
    )
    parser.add_argument("--small", action="store_true", help="20 surfaces")
    parser.add_argument("--plot", metavar="FILE", help="a histogram")
    given = parser.parse_args(arguments)
    TRUSTED.set(given.trust)
    surrogate = Surrogate.load(given.surrogate)
    (target, about), *_ = surrogate.card["targets"].items()
    scene, unit = Scene.from_text(surrogate.card["scene"]), about["unit"]
    middle = {
        n: quantiles(d, np.array([0.5]))[0] for n, d in scene.drawn_parameters.items()
    }
    asked = {name: float(value) for name, value in given.set}
    if asked.keys() - middle.keys():
        parser.error(f"--set: the scene has {', '.join(middle) or 'no parameters'}")
    scene = scene.with_parameters(middle | asked)
    delta = given.delta or np.mean(surrogate.card["delta"])
    ratios = surrogate.hardness_limits
    hardness = None if ratios is None else np.sqrt(np.prod(ratios)) * surrogate.modulus
    values, flagged, errors = [], 0, []
    for number in range(20 if given.small else given.surfaces):
        heights = surface_numbered(scene, number)
        answer = surrogate.predict(heights, scene.sides, delta, hardness=hardness)
        values.append(answer.values[target][0])
        flagged += not answer.inside[0]
        with suppress(
            *UNSOLVED, AttributeError
        ):  # a target that is no result of every contact
            if number < 10:
                solved = getattr(
                    solve_contact(scene, heights, delta, hardness), about["column"]
                )
                errors.append((abs(values[-1] - solved), abs(solved)))
    scatter = f" +- {np.std(values, ddof=1):.2g}" if len(values) > 1 else ""
    ending = "" if unit == "1" else f" {unit}"  # a pure number
    print(f"{target} at Delta = {delta:g} um: {np.mean(values):.3g}{scatter}{ending}")
    if scatter:
        low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
        print(
            f"median {middle:.3g}, nine of ten surfaces between {low:.3g} and {high:.3g}{ending}"
        )
    print(f"{flagged} of {len(values)} surfaces lie outside the training ranges")
    if errors:
        off, size = np.mean(errors, axis=0)
        error = f"{100 * off / size:.2g} %" if size > 0 else f"{off:.2g}{ending}"
        print(f"mean error where the contact was solved too ({len(errors)}): {error}")
    if given.plot:
        from matplotlib.figure import Figure

        axis = Figure(figsize=(5, 3.5), layout="constrained").subplots()
        axis.hist(values, bins=30)
        axis.set(xlabel=f"{target} [{unit}]", ylabel="surfaces")
        axis.yaxis.get_major_locator().set_params(integer=True)
        axis.figure.savefig(given.plot)
    return np.array(values)


if __name__ == "__main__":
    run_script(main)
