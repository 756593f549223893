"""Does a surface that has yielded once yield again?

    python examples/unloading.py --hardness 2000 --pressure 50

Steel is pressed to a nominal pressure, unloaded, and loaded again. The softer body keeps the depth
by which it yielded (`Contact.flattened`), so that the second law is elastic up to the first load
and yields again beyond it: shakedown.
"""

import argparse

import numpy as np

import bem
from gen.runtime.command_line import run_script
from gen.surface import generate


def main(arguments: list[str]) -> np.ndarray:
    """Return pressure [MPa], first and second area, first and second yielded share [%]."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hardness", type=float, default=2000.0, help="[MPa]")
    parser.add_argument(
        "--pressure", type=float, default=50.0, help="of the first loading [MPa]"
    )
    parser.add_argument("--young", type=float, default=210e3, help="[MPa]")
    parser.add_argument("--small", action="store_true", help="65 nodes a side")
    parser.add_argument("--plot", metavar="FILE", help="both laws")
    given = parser.parse_args(arguments)
    side = 1000.0
    heights = generate(
        "diamond-square",
        65 if given.small else 257,
        0.7,
        1.0,
        np.random.default_rng(2025),
    )
    settings = {"modulus": given.young, "poisson": 0.3, "hardness": given.hardness}
    loads = given.pressure * np.array([0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2])
    new = list(bem.ladder(heights, side, pressures=loads, **settings))
    flattened = new[5].flattened  # after the load asked for, and before the one beyond
    worn = list(bem.ladder(flattened, side, pressures=loads, **settings))
    law = np.array(
        [
            [load, a.area_percent, b.area_percent, a.yielded_percent, b.yielded_percent]
            for load, a, b in zip(loads, new, worn, strict=True)
        ]
    )
    print("pressure [MPa]   area [%]: new, again    yielded [%]: new, again")
    for row in law:
        print("{:10.4g} {:16.3f} {:8.3f} {:16.3f} {:8.3f}".format(*row))
    if given.plot:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(5, 3.5), layout="constrained")
        axis = figure.subplots()
        axis.plot(law[:, 0], law[:, 1], "o-", label="first loading")
        axis.plot(law[:, 0], law[:, 2], "s--", label="second loading")
        axis.set(xlabel="nominal pressure [MPa]", ylabel="contact area [%]")
        axis.legend()
        figure.savefig(given.plot)
    return law


if __name__ == "__main__":
    run_script(main)
