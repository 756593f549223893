"""Which texture makes a joint whose stiffness grows in proportion to the pressure?

    python examples/texture.py --plot texture.png

The surface of a steel body is a sum of waves. If its mean gap falls by 0.5 um whenever the pressure
p grows by the factor e, the joint has the stiffness p / 0.5 um. Nonlinear least squares look for
such waves, with the derivatives of the mean gaps by all heights from `Contact.gradient`.
"""

import argparse
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

import bem
from gen.runtime.command_line import run_script

PRESSURES = np.array([5.0, 10.0, 20.0, 30.0, 40.0, 50.0])  # [MPa]
WANTED = 0.5 * np.log(100 / PRESSURES)  # mean gap [um], which would be 0 under 100 MPa
STEPS = 50  # most evaluations of all gaps
WAVES = np.r_[0:7, -6:0]  # numbers of waves along x; along y there are 0 to 6


@dataclass(frozen=True)
class Texture:
    """Textures of 1 mm a side; `numbers` are real and imaginary parts of their waves [um]."""

    nodes: int  # along a side

    def heights(self, numbers: np.ndarray) -> np.ndarray:
        """Return the heights of a texture, (nodes, nodes) [um]."""
        real, imaginary = numbers.reshape(2, len(WAVES), 7)
        spectrum = np.zeros((self.nodes, self.nodes // 2 + 1), dtype=complex)
        spectrum[WAVES, :7] = real + 1j * imaginary
        spectrum[0, 0] = 0
        return np.fft.irfft2(spectrum, s=(self.nodes, self.nodes)) * self.nodes**2

    def by_numbers(self, by_heights: np.ndarray) -> np.ndarray:
        """Turn derivatives by the heights into derivatives by the numbers of a texture."""
        spectrum = np.fft.rfft2(by_heights)[WAVES, :7]
        spectrum[0, 0] = 0
        spectrum[:, 1:] *= 2  # each wave stands for itself and its conjugate
        return np.concatenate((spectrum.real.ravel(), spectrum.imag.ravel()))

    def contacts(self, numbers: np.ndarray) -> list[bem.Contact]:
        """Solve the contact of a texture under each pressure."""
        steel = {"modulus": 210e3, "poisson": 0.3, "boundary": "periodic"}
        heights = self.heights(numbers)
        return list(bem.ladder(heights, 1000.0, pressures=PRESSURES, **steel))

    def gaps(self, numbers: np.ndarray) -> np.ndarray:
        """Return the mean gap of a texture under each pressure [um]."""
        return np.array([contact.mean_gap for contact in self.contacts(numbers)])

    def derivatives(self, numbers: np.ndarray) -> np.ndarray:
        """Return the derivatives of the gaps by the numbers, (pressures, numbers)."""
        gradients = [contact.gradient("mean_gap") for contact in self.contacts(numbers)]
        return np.array([self.by_numbers(gradient) for gradient in gradients])


def main(arguments: list[str]) -> dict[str, np.ndarray]:
    """Return pressures [MPa] and gaps [um]: wanted, of the first and of the found texture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--nodes", type=int, default=64, help="along a side")
    parser.add_argument("--seed", type=int, default=1, help="of the first texture")
    parser.add_argument("--plot", metavar="FILE", help="texture and gaps")
    options = parser.parse_args(arguments)
    texture = Texture(options.nodes)
    random = np.random.default_rng(options.seed)
    start = random.normal(scale=0.03, size=2 * len(WAVES) * 7)
    result = least_squares(
        lambda numbers: texture.gaps(numbers) / WANTED - 1,
        start,
        jac=lambda numbers: texture.derivatives(numbers) / WANTED[:, np.newaxis],
        method="dogbox",
        max_nfev=STEPS,
    )
    gaps = {"pressure": PRESSURES, "wanted": WANTED, "start": texture.gaps(start)}
    gaps["texture"] = texture.gaps(result.x)
    print(f"{result.nfev} steps\npressure [MPa]   mean gap [um]: wanted, start, texture")
    for row in zip(*gaps.values(), strict=True):
        print("{:14.4g} {:22.4f} {:6.4f} {:8.4f}".format(*row))
    if options.plot:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8, 3.5), layout="constrained")
        surface, curve = figure.subplots(1, 2)
        figure.colorbar(surface.imshow(texture.heights(result.x)), label="height [um]")
        surface.set(xticks=[], yticks=[], title="one millimetre a side")
        for name, style in {"wanted": "k-", "start": "o--", "texture": "s"}.items():
            curve.plot(PRESSURES, gaps[name], style, label=name)
        curve.set(xlabel="pressure [MPa]", ylabel="mean gap [um]", ylim=(0, None))
        curve.legend()
        figure.savefig(options.plot, dpi=150)
    return gaps


if __name__ == "__main__":
    run_script(main)
