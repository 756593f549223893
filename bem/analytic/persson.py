"""Laws of random rough surfaces without edges: contact area, mean gap and stiffness.

Bush, Gibson and Thomas, Wear 35 (1975); Persson, Journal of Chemical Physics 115 (2001); Persson,
Physical Review Letters 99, 125502 (2007); Yang and Persson, Journal of Physics: Condensed Matter
20, 215214 (2008).

The reduced pressure is p / (E* h'), where h' is the rms of the modulus of the surface's gradient:
h'^2 = <(dz/dx)^2 + (dz/dy)^2>. In full contact the pressure is E* |q| / 2 times each component of
the heights, so that it scatters by E* h' / 2 about its mean. Persson's theory lets the pressure
diffuse from the mean to this scatter, with an absorbing wall at no pressure; the share that is
left is erf(p / (sqrt(2) E* h' / 2)) = erf(sqrt(2) p / (E* h')), whose slope at no load is
sqrt(8 / pi). With h' along one axis only, smaller by sqrt(2) on isotropic surfaces, the same law
reads erf(p / (E* h'_x)). The form erf(sqrt(pi) p / (E* h')) has the slope 2 of many computed
contacts: it is fitted, not derived.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import erf, exp1

from bem.arrays import Values

BUSH_GIBSON_THOMAS = math.sqrt(2 * math.pi)
"""Slope of the area share over the reduced pressure at no load: paraboloids at all summits."""

PERSSON = math.sqrt(8 / math.pi)
"""Slope of the area share over the reduced pressure at no load: diffusion of the pressure."""

# Steps of the quadrature over the waves. They are finest for the longest waves, which light loads
# flatten no more: pressures from p / (E* h') = 1e-6 are resolved.
STEPS = 3000

# Nodes and weights of Gauss and Legendre's quadrature from -1 to 1.
QUADRATURE = np.polynomial.legendre.leggauss(40)

# Value of x beyond which exp(-x^2) is below rounding.
FAR = 7.0


def area_share(reduced_pressure: Values, slope: float = PERSSON) -> Values:
    """Compute the share of the surface that is in contact, erf(sqrt(pi) / 2 slope p / (E* h')).

    Parameters
    ----------
    reduced_pressure : ndarray
        Mean pressure p / (E* h'), h' the rms of the gradient's modulus [1].
    slope : float
        Slope kappa at no load: `PERSSON` gives his erf(sqrt(2) p / (E* h')), 2 the fitted form
        erf(sqrt(pi) p / (E* h')) [1].

    Returns
    -------
    ndarray, shape of reduced_pressure
        Contact area as a share of the whole [1].
    """
    return np.asanyarray(
        erf(math.sqrt(math.pi) / 2 * slope * np.asanyarray(reduced_pressure))
    )


@dataclass(frozen=True, eq=False)
class PerssonInterface:
    """Persson's relation between mean pressure and mean gap, from a power spectrum.

    The elastic energy at wavenumber q is that of full contact times W = P (gamma + (1 - gamma)
    P^2), where P(q, p) is the area share that Persson's law gives with the waves up to q only. The
    mean gap follows from the work that closes it, dU/dp = -p d(gap)/dp.

    Attributes
    ----------
    wavenumbers : ndarray, shape (m,)
        Wavenumbers q, rising, dense enough for the trapezoidal rule [1/um].
    spectrum : ndarray, shape (m,)
        Isotropic power spectrum C(q), whose integral of 2 pi q C is the mean square height [um^4].
    gamma : float
        Share of full contact's elastic energy that a small contact holds: 1 in Persson (2007),
        0.45 after the computed contacts of Yang and Persson (2008) [1].
    """

    wavenumbers: Values
    spectrum: Values
    gamma: float = 0.45

    def __post_init__(self) -> None:
        """Keep copies of the spectrum, which the caller may change."""
        for name in ("wavenumbers", "spectrum"):
            given = getattr(self, name)
            if np.ma.is_masked(given):
                raise ValueError(f"{name} are masked in places: fill or crop them")
            object.__setattr__(self, name, np.array(given, dtype=np.float64))

    def rms_height(self) -> float:
        """Return the rms height of these waves [um].

        Returns
        -------
        float
            Square root of the integral of 2 pi q C [um].
        """
        moment = np.trapezoid(self.wavenumbers * self.spectrum, self.wavenumbers)
        return math.sqrt(2 * math.pi * float(moment))

    def rms_slope(self) -> float:
        """Return the rms of the gradient's modulus of these waves [1].

        Returns
        -------
        float
            Square root of the integral of 2 pi q^3 C [1].
        """
        return math.sqrt(2 * float(self._squared_scatter()[-1]))

    def mean_gap(self, pressure: Values, modulus: float = 1.0) -> Values:
        """Compute the mean gap by quadrature over the waves.

        Parameters
        ----------
        pressure : ndarray, shape (k,)
            Mean pressure, above 0 [MPa].
        modulus : float
            E* [MPa].

        Returns
        -------
        ndarray, shape (k,)
            Mean gap: infinite without load, as random surfaces without end have no highest point,
            and zero in full contact [um].
        """
        return self._sum_over_waves(_work(self._ratios(pressure, modulus), self.gamma))

    def stiffness(self, pressure: Values, modulus: float = 1.0) -> Values:
        """Compute the stiffness dp/dDelta = -dp/d(mean gap), which is p / u0 at light load.

        Parameters
        ----------
        pressure : ndarray, shape (k,)
            Mean pressure, above 0 [MPa].
        modulus : float
            E* [MPa].

        Returns
        -------
        ndarray, shape (k,)
            Stiffness of the interface per area; infinite in full contact [MPa/um].
        """
        lengths = self._sum_over_waves(
            _energy_rate(self._ratios(pressure, modulus), self.gamma)
        )
        with np.errstate(divide="ignore"):
            return np.asanyarray(pressure / lengths)

    def light_load_length(self) -> float:
        """Return u0 of dp/dDelta = p / u0 and mean gap = u0 ln(constant / p) at light load [um].

        Returns
        -------
        float
            Length u0 [um].
        """
        return float(self._sum_over_waves(np.array(self.gamma)))

    def _squared_scatter(self) -> Values:
        """Return h'(q)^2 / 2, with h'(q) the rms slope of the waves up to q, (m,) [1]."""
        density = np.pi * self.wavenumbers**3 * self.spectrum
        steps = np.diff(self.wavenumbers) * (density[1:] + density[:-1]) / 2
        return np.concatenate([[0.0], np.cumsum(steps)])

    def _scatter(self) -> Values:
        """Return the values of h'(q) / sqrt(2) for the quadrature, from 0, (STEPS + 1,) [1]."""
        largest = math.sqrt(self._squared_scatter()[-1])
        return np.asanyarray(largest * np.linspace(0, 1, STEPS + 1) ** 2)

    def _ratios(self, pressure: Values, modulus: float) -> Values:
        """Return x = p / (E* scatter), of which erf(x) is the area share P, (k, STEPS + 1) [1]."""
        with np.errstate(divide="ignore"):
            ratios: Values = pressure[:, None] / (modulus * self._scatter())
        return ratios

    def _sum_over_waves(self, values: Values) -> Values:
        """Integrate 2 / sqrt(pi) values / q over the scatter, values of shape (..., STEPS + 1)."""
        scatter = self._scatter()
        wavenumbers = np.interp(scatter**2, self._squared_scatter(), self.wavenumbers)
        sums = np.trapezoid(values / wavenumbers, scatter, axis=-1)
        return np.asanyarray(2 / math.sqrt(math.pi) * sums)


def _energy_rate(ratios: Values, gamma: float) -> Values:
    """Compute sqrt(pi) / 2 dW/dx, where W is the share of full contact's energy and P = erf(x)."""
    shape = gamma + 3 * (1 - gamma) * erf(ratios) ** 2
    return np.asanyarray(shape * np.exp(-(ratios**2)))


def _work(ratios: Values, gamma: float) -> Values:
    """Integrate `_energy_rate` / x from these ratios to infinity.

    Its first term is an exponential integral; the second one, without a pole, is left to Gauss and
    Legendre.
    """
    total = np.zeros(ratios.shape)
    near = np.minimum(ratios, FAR)
    for node, weight in zip(*QUADRATURE, strict=True):
        x = near + FAR * (node + 1) / 2
        total += weight * FAR / 2 * np.exp(-(x**2)) * erf(x) ** 2 / x
    return np.asanyarray(gamma * exp1(ratios**2) / 2 + 3 * (1 - gamma) * total)
