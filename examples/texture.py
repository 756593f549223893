"""Which texture makes a joint whose stiffness grows in proportion to the pressure?

    python examples/texture.py --plot texture.png

A texture of waves repeats itself on steel. Its mean gap is wanted to fall by 0.5 um whenever the
pressure grows by the factor e: the joint then has the stiffness p / 0.5 um. The waves are changed
by nonlinear least squares until the gaps under six pressures are the wanted ones. Each step solves
six contacts, and takes the derivatives of their mean gaps by all heights from `Contact.gradient`:
their cost does not grow with the number of waves.
"""

import argparse
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

import bem
from gen.runtime.command_line import run_script

SIDE = 1000.0  # of the patch [um]
MOST_WAVES = 6  # along a side
DECAY = 0.5  # of the mean gap, whenever the pressure grows by e [um]
CLOSED = 100.0  # pressure at which the wanted gap is 0 [MPa]
STEPS = 50
YOUNG = 210e3  # of steel [MPa]
POISSON = 0.3


@dataclass(frozen=True, eq=False)
class Texture:
    """Textures of a few waves, and the gaps that are wanted of them."""

    nodes: int  # along a side
    pressures: np.ndarray  # [MPa]
    wanted: np.ndarray  # mean gap under each pressure [um]

    @property
    def waves(self) -> int:
        """Number of the real numbers that describe a texture."""
        return 2 * (2 * MOST_WAVES + 1) * (MOST_WAVES + 1)

    def heights(self, numbers: np.ndarray) -> np.ndarray:
        """Return the heights of a texture, (nodes, nodes) [um]."""
        real, imaginary = numbers.reshape(2, 2 * MOST_WAVES + 1, MOST_WAVES + 1)
        spectrum = np.zeros((self.nodes, self.nodes // 2 + 1), dtype=complex)
        spectrum[self._rows, : MOST_WAVES + 1] = real + 1j * imaginary
        spectrum[0, 0] = 0
        return np.fft.irfft2(spectrum, s=(self.nodes, self.nodes)) * self.nodes**2

    def by_numbers(self, by_heights: np.ndarray) -> np.ndarray:
        """Turn derivatives by the heights into derivatives by the numbers of a texture."""
        spectrum = np.fft.rfft2(by_heights)[self._rows, : MOST_WAVES + 1]
        spectrum[0, 0] = 0
        spectrum[:, 1:] *= 2  # each wave stands for itself and its conjugate
        return np.concatenate((spectrum.real.ravel(), spectrum.imag.ravel()))

    @property
    def _rows(self) -> np.ndarray:
        """Rows of the spectrum with the waves of a texture."""
        return np.r_[0 : MOST_WAVES + 1, -MOST_WAVES:0]

    def contacts(self, numbers: np.ndarray) -> list[bem.Contact]:
        """Solve the contact of a texture under each pressure."""
        return list(
            bem.ladder(
                self.heights(numbers),
                SIDE,
                pressures=self.pressures,
                modulus=YOUNG,
                poisson=POISSON,
                boundary="periodic",
            )
        )

    def misfits(self, numbers: np.ndarray) -> np.ndarray:
        """Return the relative misfits of the gaps, (pressures,) [1]."""
        gaps = [contact.mean_gap for contact in self.contacts(numbers)]
        return np.array(gaps) / self.wanted - 1

    def derivatives(self, numbers: np.ndarray) -> np.ndarray:
        """Return the derivatives of the misfits by the numbers of a texture, (pressures, waves)."""
        rows = [
            self.by_numbers(contact.gradient("mean_gap"))
            for contact in self.contacts(numbers)
        ]
        return np.array(rows) / self.wanted[:, np.newaxis]


def main(arguments: list[str]) -> dict[str, np.ndarray]:
    """Return pressures [MPa], and gaps [um]: wanted, at the start, and of the texture found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--nodes", type=int, default=64, help="along a side")
    parser.add_argument("--seed", type=int, default=1, help="of the first texture")
    parser.add_argument("--plot", metavar="FILE", help="texture and gaps")
    options = parser.parse_args(arguments)
    pressures = np.array([5.0, 10.0, 20.0, 30.0, 40.0, 50.0])
    wanted = DECAY * np.log(CLOSED / pressures)
    texture = Texture(options.nodes, pressures, wanted)
    random = np.random.default_rng(options.seed)
    start = random.normal(scale=0.03, size=texture.waves)
    result = least_squares(
        texture.misfits,
        start,
        jac=texture.derivatives,
        method="dogbox",
        max_nfev=STEPS,
    )
    gaps = {"pressure": pressures, "wanted": wanted}
    for name, numbers in {"start": start, "texture": result.x}.items():
        contacts = texture.contacts(numbers)
        gaps[name] = np.array([contact.mean_gap for contact in contacts])
    print(f"{result.nfev} steps")
    print("pressure [MPa]   mean gap [um]: wanted, start, texture")
    for row in zip(*gaps.values(), strict=True):
        print("{:14.4g} {:22.4f} {:6.4f} {:8.4f}".format(*row))
    if options.plot:
        plot(options.plot, texture.heights(result.x), gaps)
    return gaps


def plot(path: str, heights: np.ndarray, gaps: dict[str, np.ndarray]) -> None:
    """Draw the heights of a texture [um], and its gaps [um] over the pressure [MPa]."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 3.5), layout="constrained")
    surface, curve = figure.subplots(1, 2)
    picture = surface.imshow(heights.T, origin="lower", extent=(0, SIDE, 0, SIDE))
    surface.set(xlabel="x [um]", ylabel="y [um]")
    figure.colorbar(picture, ax=surface, label="height [um]")
    curve.semilogx(gaps["pressure"], gaps["wanted"], "k-", label="wanted")
    curve.semilogx(gaps["pressure"], gaps["start"], "o--", label="first texture")
    curve.semilogx(gaps["pressure"], gaps["texture"], "s", label="this texture")
    curve.minorticks_off()
    curve.set_xticks(gaps["pressure"], [f"{pressure:g}" for pressure in gaps["pressure"]])
    curve.set(xlabel="pressure [MPa]", ylabel="mean gap [um]", ylim=(0, None))
    curve.legend()
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    run_script(main)
