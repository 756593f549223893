"""Laws of random rough surfaces without edges: contact area, mean gap and stiffness.

Bush, Gibson and Thomas, Wear 35 (1975); Persson, Journal of Chemical Physics 115 (2001); Persson,
Physical Review Letters 99, 125502 (2007); Yang and Persson, Journal of Physics: Condensed Matter
20, 215214 (2008).

The reduced pressure is p / (E* h'), where h' is the rms of the modulus of the surface's gradient:
h'^2 = <(dz/dx)^2 + (dz/dy)^2>. In full contact each wave of the heights with wavenumber q has a
wave of pressure that is E* q / 2 times as large, so that the pressure has the standard deviation
E* h' / 2 about its mean. In Persson's theory the distribution of pressure diffuses from the mean to
this width as shorter waves are added, with an absorbing wall at zero pressure. The share that is
not absorbed is the contact area, erf(p / (sqrt(2) E* h' / 2)) = erf(sqrt(2) p / (E* h')), with the
slope sqrt(8 / pi) at zero load. The slope along one axis h'_x is smaller by sqrt(2) on isotropic
surfaces; written with it, the law is erf(p / (E* h'_x)). The form erf(sqrt(pi) p / (E* h')) has the
slope 2 of many computed contacts. It is fitted, not derived.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import erf, exp1

from bem.arrays import Values

BUSH_GIBSON_THOMAS = math.sqrt(2 * math.pi)
"""Slope of the area share over the reduced pressure at zero load, by contact of paraboloids at
all summits [1]."""

PERSSON = math.sqrt(8 / math.pi)
"""Slope of the area share over the reduced pressure at zero load, by diffusion of the pressure
[1]."""

# Number of steps of the quadrature over the waves. They are finest for the longest waves, the only
# ones that light loads flatten, so that pressures from p / (E* h') = 1e-6 are resolved.
STEPS = 3000

# Nodes and weights of Gauss and Legendre's quadrature from -1 to 1.
QUADRATURE = np.polynomial.legendre.leggauss(40)

# Length of the range of x that is integrated: exp(-x^2) is below rounding at this x [1].
FAR = 7.0


def area_share(reduced_pressure: Values, slope: float = PERSSON) -> Values:
    """Compute the contact area as a share of the surface, erf(sqrt(pi) / 2 slope p / (E* h')).

    Parameters
    ----------
    reduced_pressure : ndarray
        Reduced mean pressure p / (E* h'), with the rms h' of the gradient's modulus [1].
    slope : float
        Slope at zero load. `PERSSON` gives his law erf(sqrt(2) p / (E* h')), 2 the fitted form
        erf(sqrt(pi) p / (E* h')) [1].

    Returns
    -------
    ndarray, shape of reduced_pressure
        Contact area as a share of the whole [1].
    """
    scale = math.sqrt(math.pi) / 2 * slope
    return np.asanyarray(erf(scale * np.asanyarray(reduced_pressure)))


@dataclass(frozen=True, eq=False)
class PerssonInterface:
    """Persson's relation between mean pressure and mean gap, from a power spectrum.

    The elastic energy of the waves of wavenumber q is that of full contact times
    W = P (gamma + (1 - gamma) P^2). Here P(q, p) is the area share of Persson's law at the pressure
    p for a surface with only the waves up to q. The mean gap follows from the work that closes it:
    dU/dp = -p d(gap)/dp for the energy U of all waves.

    Attributes
    ----------
    wavenumbers : ndarray, shape (m,)
        Wavenumbers q, rising, dense enough for the trapezoidal rule [1/um].
    spectrum : ndarray, shape (m,)
        Isotropic power spectrum C(q). The integral of 2 pi q C is the mean square height [um^4].
    gamma : float
        Elastic energy per area of contact where the contact is small, over that in full contact: 1
        in Persson (2007), 0.45 by the computed contacts of Yang and Persson (2008) [1].

    Raises
    ------
    ValueError
        If wavenumbers or spectrum are masked in places.
    """

    wavenumbers: Values
    spectrum: Values
    gamma: float = 0.45

    def __post_init__(self) -> None:
        """Replace wavenumbers and spectrum by copies, because the caller may change them.

        Raises ValueError if either is masked in places.
        """
        for name in ("wavenumbers", "spectrum"):
            values = getattr(self, name)
            if np.ma.is_masked(values):
                raise ValueError(f"{name} are masked in places: fill or crop them")
            object.__setattr__(self, name, np.array(values, dtype=np.float64))

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
            Mean gap [um]. It tends to infinity without load, because random surfaces without end
            have no highest point, and to zero in full contact.
        """
        ratios = self._ratios(pressure, modulus)
        return self._sum_over_waves(_work(ratios, self.gamma))

    def stiffness(self, pressure: Values, modulus: float = 1.0) -> Values:
        """Compute the stiffness dp/dDelta = -dp/d(mean gap).

        At light load it is p / `light_load_length`.

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
        ratios = self._ratios(pressure, modulus)
        lengths = self._sum_over_waves(_energy_rate(ratios, self.gamma))
        with np.errstate(divide="ignore"):
            return np.asanyarray(pressure / lengths)

    def light_load_length(self) -> float:
        """Return the length u0 of the law at light load [um].

        There, dp/dDelta = p / u0, and the mean gap is u0 ln(constant / p).

        Returns
        -------
        float
            Length u0 [um].
        """
        return float(self._sum_over_waves(np.array(self.gamma)))

    def _squared_scatter(self) -> Values:
        """Return h'(q)^2 / 2 for each wavenumber by the trapezoidal rule, (m,) [1].

        h'(q) is the rms slope of the waves up to q.
        """
        density = np.pi * self.wavenumbers**3 * self.spectrum
        steps = np.diff(self.wavenumbers) * (density[1:] + density[:-1]) / 2
        return np.concatenate([[0.0], np.cumsum(steps)])

    def _scatter(self) -> Values:
        """Return the values of h'(q) / sqrt(2) at which the quadrature is taken, (STEPS + 1,) [1].

        They rise from 0 to the value of all waves.
        """
        largest = math.sqrt(self._squared_scatter()[-1])
        return np.asanyarray(largest * np.linspace(0, 1, STEPS + 1) ** 2)

    def _ratios(self, pressure: Values, modulus: float) -> Values:
        """Return x = p / (E* h'(q) / sqrt(2)) for (k,) pressures, (k, STEPS + 1) [1].

        The area share P with the waves up to q is erf(x).
        """
        with np.errstate(divide="ignore"):
            ratios: Values = pressure[:, None] / (modulus * self._scatter())
        return ratios

    def _sum_over_waves(self, values: Values) -> Values:
        """Integrate 2 / sqrt(pi) values / q over h'(q) / sqrt(2) [um].

        The last axis of `values` has one value for each entry of `_scatter`, and is summed over.
        """
        scatter = self._scatter()
        wavenumbers = np.interp(scatter**2, self._squared_scatter(), self.wavenumbers)
        sums = np.trapezoid(values / wavenumbers, scatter, axis=-1)
        return np.asanyarray(2 / math.sqrt(math.pi) * sums)


def _energy_rate(ratios: Values, gamma: float) -> Values:
    """Compute sqrt(pi) / 2 dW/dx at `ratios` x, with W(x) of `PerssonInterface` for P = erf(x)."""
    shape = gamma + 3 * (1 - gamma) * erf(ratios) ** 2
    return np.asanyarray(shape * np.exp(-(ratios**2)))


def _work(ratios: Values, gamma: float) -> Values:
    """Integrate `_energy_rate`(x) / x over x, from each of the ratios to infinity.

    The first term of the integrand gives an exponential integral. The second one has no pole, and
    is integrated by quadrature. The result has the shape of the ratios.
    """
    total = np.zeros(ratios.shape)
    near = np.minimum(ratios, FAR)  # beyond it the second term is below rounding
    nodes, weights = QUADRATURE
    # Integrate from each ratio to `FAR` beyond it.
    for node, weight in zip(nodes, weights, strict=True):
        x = near + FAR * (node + 1) / 2
        total += weight * FAR / 2 * np.exp(-(x**2)) * erf(x) ** 2 / x
    first_term = gamma * exp1(ratios**2) / 2
    return np.asanyarray(first_term + 3 * (1 - gamma) * total)
