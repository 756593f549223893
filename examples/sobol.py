"""Which input makes the contact area scatter: what the scene draws, Delta, or chance?

    pip install -e ".[examples]"
    python examples/sobol.py area.surrogate --samples 512

Sobol indices by SALib. Chance is an input too: which of 2^20 surfaces it is. First order is an
input's own share of the variance, the total includes its interplay with the others. A surrogate
that was fitted with --features scene answers for all surfaces at once: there chance is no input.
"""

import argparse

import numpy as np
from SALib.analyze import sobol as analysis
from SALib.sample import sobol as sampling

from gen.distribution import is_drawn, log_within, quantiles
from gen.generation.sample import surface_numbered
from gen.runtime.command_line import run_script
from gen.runtime.user_code import TRUSTED
from gen.scene import Scene
from learn import Surrogate
from learn.features.scene import shown


def main(arguments: list[str]) -> dict[str, np.ndarray]:
    """Return the indices "S1" and "ST" of the drawn parameters, Delta and chance."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("surrogate", help="made by asperity learn fit")
    parser.add_argument("--samples", type=int, default=512, help="a power of two")
    parser.add_argument(
        "--trust", action="store_true", help="run the scene's own function"
    )
    parser.add_argument("--small", action="store_true", help="32 samples")
    given = parser.parse_args(arguments)
    TRUSTED.set(given.trust)
    surrogate = Surrogate.load(given.surrogate)
    scene = Scene.from_text(surrogate.card["scene"])
    drawn = {
        name: each for name, each in scene.drawn_parameters.items() if is_drawn(each)
    }
    low, high = surrogate.hardness_limits or (0.0, 0.0)
    of_scene = surrogate.features.name == "scene"
    inputs = [*drawn, *(["hardness"] if low < high else []), "Delta", "chance"]
    names = [*surrogate.features.names] if of_scene else inputs
    problem = {
        "num_vars": len(names),
        "names": names,
        "bounds": [[0.0, 1.0]] * len(names),
    }
    number = 32 if given.small else given.samples
    target = next(iter(surrogate.learnt))

    def answer(shares: np.ndarray) -> float:
        """Predict at one point of the unit cube, whose sides are shares of probability."""
        share = dict(zip(names, shares[:, None], strict=True))
        values = {
            name: float(quantiles(each, share[name])[0]) for name, each in drawn.items()
        }
        heights = surface_numbered(
            scene.with_parameters(values), int(2**20 * share["chance"][0])
        )
        delta = quantiles(tuple(surrogate.card["delta"]), share["Delta"])
        ratio = log_within(low, high, share["hardness"])[0] if low < high else None
        hardness = None if ratio is None else ratio * surrogate.modulus
        given = surrogate.predict(
            heights, scene.sides, delta, hardness=hardness, level=None
        )
        return given.values[target][0]

    def answers_of_scene(shares: np.ndarray) -> np.ndarray:
        """Predict the means at points of the unit cube; hardness and load lie within their ends."""
        ranges = surrogate.low + shares * (surrogate.high - surrogate.low)
        values = dict(
            zip(names, shown(surrogate.features.columns, ranges).T, strict=True)
        )
        values |= {
            name: quantiles(drawn[name], shares[:, names.index(name)]) for name in drawn
        }
        return surrogate.predict(**values, level=None).values[target]

    points = sampling.sample(problem, number, calc_second_order=False, seed=2025)
    values = answers_of_scene(points) if of_scene else np.array([*map(answer, points)])
    found = analysis.analyze(problem, values, calc_second_order=False, seed=2025)
    print(
        f"{len(values)} values of {target}: mean {values.mean():.3g}, std {values.std():.3g}"
    )
    for place, name in enumerate(names):
        words = []
        for index, word in {"S1": "first order", "ST": "total"}.items():
            bar = found[f"{index}_conf"][place]  # by resampling: one sample has none
            bar = f" +- {bar:4.2f}" if number > 1 and np.isfinite(bar) else ""
            words.append(f"{word} {found[index][place]:5.2f}{bar}")
        print(f"{name:10} {', '.join(words)}")
    return {index: found[index] for index in ("S1", "ST")}


if __name__ == "__main__":
    run_script(main)
