"""Elastic bodies: compliances against elasticity, contacts on layers against closed forms."""

import math
import pickle
import sys
from dataclasses import dataclass, replace

import mpmath
import numpy as np
import pytest
import scipy.special
from scipy.integrate import solve_ivp

import bem
from bem import HalfSpace, Layered
from bem.bodies import HALF_SPACE, ConcentratedForces
from bem.influence import InfluenceMatrix, influence_coefficients
from bench.references import dense
from bench.references.edgeless import Patch

BASE = HalfSpace(1.0, 0.2)


def rough(nodes, seed, power=1.8):
    """Return a random surface of unit standard deviation whose waves have 4 nodes or more."""
    random = np.random.default_rng(seed)
    along, across = np.fft.fftfreq(nodes), np.fft.rfftfreq(nodes)
    length = np.hypot(along[:, np.newaxis], across)
    length[0, 0] = np.inf
    waves = np.fft.rfft2(random.normal(size=(nodes, nodes))) * length**-power
    heights = np.fft.irfft2(np.where(length < 0.25, waves, 0), s=(nodes, nodes))
    return heights / heights.std()


def by_elasticity(q, body):
    """Solve plane strain by Airy's functions f(z) cos(q x), with 40 digits; no formula of `bem`.

    f is (a + b z) exp(q z) + (c + d z) exp(-q z) in the layer and (e + g z) exp(-q z) below.
    """
    q, depth = mpmath.mpf(q), mpmath.mpf(body.thickness)

    def rows(z, poisson, shear, falls):
        """Return f, f', u_x and u_z at z of (1, z) exp(q z) or of (1, z) exp(-q z)."""
        columns = []
        for factor in (0, 1):
            s = -q if falls else q
            e = mpmath.exp(s * z)
            f = [
                e
                * (
                    s**n * (z if factor else 1)
                    + (n * s ** (n - 1) if factor and n else 0)
                )
                for n in range(4)
            ]
            along = ((1 - poisson) * f[2] + poisson * q**2 * f[0]) / q
            slope = ((1 - poisson) * f[3] + poisson * q**2 * f[1]) / q
            columns.append([f[0], f[1], along / shear, (slope / q - 2 * f[1]) / shear])
        return columns

    poisson = mpmath.mpf(body.poisson)
    shear = mpmath.mpf(body.modulus) / (1 + poisson)  # twice the shear modulus
    layer = [
        rows(z, poisson, shear, falls) for z in (0, depth) for falls in (False, True)
    ]
    top, bottom = layer[0] + layer[1], layer[2] + layer[3]
    rigid = body.base == "rigid"
    matrix = mpmath.zeros(4 if rigid else 6)
    for column in range(4):
        matrix[0, column], matrix[1, column] = top[column][0], top[column][1]
        for row in range(2 if rigid else 4):
            matrix[2 + row, column] = bottom[column][row + 2 if rigid else row]
    if not rigid:
        other = mpmath.mpf(body.base.poisson)
        below = rows(depth, other, mpmath.mpf(body.base.modulus) / (1 + other), True)
        for column in range(2):
            for row in range(4):
                matrix[2 + row, 4 + column] = -below[column][row]
    right = mpmath.zeros(matrix.rows, 1)
    right[0] = 1 / q**2
    solution = mpmath.lu_solve(matrix, right)
    return float(sum(top[column][3] * solution[column] for column in range(4)))


@pytest.mark.few(6)
@pytest.mark.parametrize("seed", range(50))
def test_the_compliance_of_a_layer_is_that_of_elasticity(seed):
    random = np.random.default_rng(seed)
    poisson = [*random.uniform(-0.9, 0.5, 2), 0.5]
    base = HalfSpace(10 ** random.uniform(-4, 6), poisson[2 * (seed % 3 == 0)])
    if seed % 4 == 0:
        base = "rigid"
    body = Layered(2.0, 3.0, poisson[1 + (seed % 5 == 0)], base)
    for depth in 10 ** random.uniform(-3, 1.3, 3):
        with mpmath.workdps(60):
            expected = by_elasticity(depth / 2.0, body)
        compliance = float(body.compliance(np.array([depth / 2.0]))[0])
        assert compliance == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.49, 0.5])
def test_a_layer_on_a_rigid_base_is_the_closed_form(poisson):
    """Johnson 1985, section 5.8; thin incompressible ones, where it cancels, by its first term."""
    body = Layered(1.0, 1 - poisson**2, poisson, "rigid")
    depths = np.array([0.06, 0.6, 6.0])
    kappa = 3 - 4 * poisson
    closed = kappa * np.sinh(2 * depths) - 2 * depths
    closed /= (
        kappa * np.cosh(2 * depths) + 2 * depths**2 + 5 - 12 * poisson + 8 * poisson**2
    )
    np.testing.assert_allclose(body.relative_compliance(depths), closed, rtol=2e-13)
    thin = float(body.compliance(np.array([1e-8]))[0])
    if poisson == 0.5:
        assert body.mean_compliance == 0
        assert thin == pytest.approx(4 / 3 * 1e-16, rel=1e-12)
    else:
        assert thin == pytest.approx(body.mean_compliance, rel=1e-12)


def test_long_waves_feel_the_base_and_short_ones_the_layer():
    body = Layered(1.0, 3.0, 0.3, BASE)
    short, long = 1e3, 1e-9
    compliances = body.compliance(np.array([long, short]))
    expected = [2 / (BASE.e_star * long), 2 / (body.e_star * short)]
    np.testing.assert_allclose(compliances, expected, rtol=1e-8)


HEIGHTS = rough(32, 1)
LOADS = ({"pressure": 0.01}, {"pressure": 0.3}, {"delta": 1.5})


def solve(body, boundary="periodic", heights=HEIGHTS, **settings):
    return bem.solve(heights, 32.0, body=body, boundary=boundary, **settings)


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize(
    ("body", "alone"),
    [
        (Layered(1e-7, 3.0, 0.3, BASE), BASE),
        (Layered(1e4, 3.0, 0.3, BASE), HalfSpace(3.0, 0.3)),
        (Layered(5.0, 1.0, 0.2, BASE), BASE),
        ((HalfSpace(2.0, 0.2), HalfSpace(2.0, 0.2)), BASE),
    ],
)
def test_limits_are_half_spaces(body, alone, load):
    contact, expected = solve(body, **load), solve(alone, **load)
    assert contact.delta == pytest.approx(expected.delta, rel=1e-5)
    assert contact.force == pytest.approx(expected.force, rel=1e-5)
    np.testing.assert_allclose(contact.gap, expected.gap, atol=1e-5 * expected.delta)
    assert contact.contact_nodes == expected.contact_nodes
    assert contact.stiffness == pytest.approx(expected.stiffness, rel=1e-4)


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
def test_a_base_that_stiffens_becomes_the_rigid_one(boundary):
    rigid = solve(Layered(4.0, 1.0, 0.3, "rigid"), boundary, pressure=0.1)
    stiff = solve(Layered(4.0, 1.0, 0.3, HalfSpace(1e9)), boundary, pressure=0.1)
    np.testing.assert_allclose(stiff.pressure, rigid.pressure, atol=1e-6)
    np.testing.assert_allclose(stiff.gap, rigid.gap, atol=1e-6)
    uniform = 0.1 * rigid.problem.body.mean_compliance
    assert stiff.delta == pytest.approx(rigid.delta - uniform, abs=1e-6)
    assert uniform == pytest.approx(0.1 * 4.0 * 1.3 * 0.4 / 0.7)


@pytest.mark.parametrize("load", LOADS)
def test_a_given_delta_on_a_rigid_base_gives_the_load_of_that_delta(load):
    body = Layered(4.0, 1.0, 0.3, "rigid")
    contact = solve(body, rtol=1e-10, **load)
    by_delta = solve(body, delta=contact.delta, rtol=1e-10)
    by_force = solve(body, force=contact.force, rtol=1e-10)
    np.testing.assert_allclose(by_delta.pressure, by_force.pressure, atol=1e-7)
    assert by_force.delta == pytest.approx(contact.delta, rel=1e-8)
    assert by_delta.mean_gap == pytest.approx(by_force.mean_gap, abs=1e-8)
    step = 1e-4 * contact.delta
    further = solve(body, delta=contact.delta + step, rtol=1e-10)
    assert further.contact_nodes == by_delta.contact_nodes
    slope = (further.force - by_delta.force) / step
    assert by_delta.loading_stiffness == pytest.approx(slope, rel=1e-3)


@pytest.mark.parametrize("base", ["rigid", HalfSpace(30.0, 0.2), HalfSpace(0.02, 0.2)])
@pytest.mark.parametrize("thicknesses", [0.1, 1.0, 10.0, 100.0])
def test_full_contact_of_one_wave(thicknesses, base):
    """The wave is that many thicknesses long, and its pressure goes down to a tenth of its mean."""
    body = Layered(32.0 / thicknesses, 1.0, 0.3, base)
    heights = np.outer(np.cos(np.pi / 16 * np.arange(32)), np.ones(32))
    amplitude = 1 / float(body.compliance(np.array([np.pi / 16]))[0])
    mean = amplitude / 0.9
    contact = solve(body, heights=heights, pressure=mean)
    np.testing.assert_allclose(contact.pressure, mean + amplitude * heights, rtol=1e-9)
    uniform = mean * body.mean_compliance
    assert contact.delta == pytest.approx(1 + uniform, rel=1e-9)
    by_delta = solve(body, heights=heights, delta=1.5 + 2 * uniform, hardness=50 * mean)
    if base == "rigid":
        expected = (0.5 + 2 * uniform) / body.mean_compliance
        assert by_delta.pressure.mean() == pytest.approx(expected, rel=1e-6)
        area = 32.0**2
        assert by_delta.stiffness == pytest.approx(area / body.mean_compliance, rel=1e-5)
        assert by_delta.interface_stiffness == math.inf


@pytest.mark.parametrize("boundary", ["free", "periodic"])
@pytest.mark.parametrize("poisson", [0.3, 0.5])
def test_thin_layers_under_a_sphere(poisson, boundary):
    """Johnson 1985, section 5.8: a layer much thinner than the spot is wide, on a rigid base."""
    nodes, delta, thickness = 96, 1.0, 1.0
    radius = 450.0 if poisson < 0.5 else 225.0
    places = np.arange(nodes) - nodes / 2
    heights = -np.add.outer(places**2, places**2) / (2 * radius)
    body = Layered(thickness, 1.0, poisson, "rigid")
    contact = bem.solve(
        heights, float(nodes), delta, spacing=1.0, body=body, boundary=boundary
    )
    if poisson < 0.5:  # pressure in proportion to the depth
        force = math.pi * radius * delta**2 / body.mean_compliance
        area = 2 * math.pi * radius * delta
    else:  # the layer is squeezed like a fluid: p = 3 G (a^2 - r^2)^2 / (32 R h^3)
        area = 4 * math.pi * radius * delta
        shear = 1 / 3
        a = math.sqrt(area / math.pi)
        force = math.pi * shear * a**6 / (32 * radius * thickness**3)
    assert contact.force == pytest.approx(force, rel=0.1)
    assert contact.area_percent == pytest.approx(100 * area / nodes**2, rel=0.1)


def by_quadrature(body, distance):
    """Integrate Hankel's transform of what a layer adds to its material, by many short panels."""
    end, waves = 40 / body.thickness, 400 + int(distance * 40 / body.thickness)
    edges = np.concatenate([np.geomspace(1e-9, 1, 200), np.linspace(1, waves, waves)[1:]])
    edges = np.concatenate([[0], edges * end / waves])
    nodes, weights = np.polynomial.legendre.leggauss(12)
    q = (edges[1:] + edges[:-1])[:, None] / 2 + np.outer(np.diff(edges) / 2, nodes)
    values = (body.relative_compliance(q) - 1) * scipy.special.j0(q * distance)
    return float((np.outer(np.diff(edges) / 2, weights) * values).sum() / np.pi)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("body", "points"),
    [
        (Layered(6.0, 1.0, 0.45, "rigid"), 8),
        (Layered(0.5, 1.0, 0.5, HalfSpace(0.02, 0.2)), 24),
        (Layered(2.0, 1.0, 0.3, HalfSpace(50.0, 0.2)), 10),
    ],
)
@pytest.mark.parametrize("aspect", [1.0, 2.5])
def test_coefficients_of_free_patches_are_those_of_a_quadrature(body, points, aspect):
    table = influence_coefficients((40, 30), body.reduced(1.0), aspect)
    surface = influence_coefficients((40, 30), HALF_SPACE, aspect)
    nodes, weights = np.polynomial.legendre.leggauss(points)
    for i, j in ((0, 0), (1, 0), (3, 2), (39, 29)):
        mean = 0.0
        for x, weight_x in zip(nodes / 2, weights / 2, strict=True):
            for y, weight_y in zip(nodes / 2, weights / 2, strict=True):
                distance = math.hypot(i + x, aspect * (j + y))
                mean += weight_x * weight_y * by_quadrature(body, distance)
        expected = surface[i, j] + aspect * mean
        assert table[i, j] == pytest.approx(expected, rel=1e-6, abs=1e-9 * table[0, 0])


@pytest.mark.few(4)
@pytest.mark.parametrize("seed", range(100))
def test_contact_of_a_free_layer_is_that_of_dense_algebra(seed):
    random = np.random.default_rng(seed)
    body = replace(random_layer(random), thickness=10 ** random.uniform(-0.6, 1.5))
    shape = tuple(int(nodes) for nodes in random.integers(3, 13, 2))
    heights, delta = random.normal(size=shape), 10 ** random.uniform(-1.5, 0.8)
    contact = bem.solve(heights, 1.0, delta, spacing=1.0, body=body, rtol=1e-9)
    every = np.arange(heights.size)
    matrix = InfluenceMatrix(shape, body.reduced(1.0), 1.0).between(every, every)
    interference = (heights - heights.max()).ravel() + delta
    expected = dense.solve(matrix / body.e_star, interference).reshape(shape)
    scale = expected.max()
    np.testing.assert_allclose(contact.pressure, expected, atol=1e-5 * scale)
    by_force = bem.solve(
        heights, 1.0, force=contact.force, spacing=1.0, body=body, rtol=1e-9
    )
    np.testing.assert_allclose(by_force.pressure, contact.pressure, atol=1e-4 * scale)


@pytest.mark.parametrize("load", LOADS)
def test_free_layers_of_one_material_are_half_spaces(load):
    contact = solve(Layered(5.0, 1.0, 0.2, BASE), "free", **load)
    expected = solve(BASE, "free", **load)
    np.testing.assert_allclose(contact.pressure, expected.pressure, atol=1e-6)
    assert contact.stiffness == pytest.approx(expected.stiffness, rel=1e-6)
    assert contact.interface_stiffness == pytest.approx(
        expected.interface_stiffness, rel=1e-6
    )


def random_layer(random):
    """Return a layer of 0.1 to 30 cells on a base that is softer, stiffer or rigid."""
    base = "rigid"
    if random.random() < 0.7:
        base = HalfSpace(10 ** random.uniform(-3, 3), random.uniform(0, 0.5))
    poisson = random.choice([0.5, random.uniform(-0.5, 0.5)])
    return Layered(
        10 ** random.uniform(-1, 1.5), 10 ** random.uniform(-2, 3), poisson, base
    )


@pytest.mark.few(10)
@pytest.mark.parametrize("seed", range(500))
def test_contact_on_a_layer_is_that_of_dense_algebra(seed):
    random = np.random.default_rng(seed)
    body, boundary = random_layer(random), ("periodic", "mirror")[seed % 2]
    shape = tuple(int(nodes) for nodes in random.integers(3, 13, 2))
    heights, hardness = random.normal(size=shape), None
    patch = Patch(heights, shape, boundary, compliance=body.compliance)
    pressure = patch.full_contact_load / heights.size * 10 ** random.uniform(-3, 0.1)
    if random.random() < 0.3:
        hardness = pressure * random.uniform(1.2, 8)
        patch.hardness = hardness
    contact = bem.solve(
        heights,
        shape,
        pressure=pressure,
        body=body,
        boundary=boundary,
        hardness=hardness,
        rtol=1e-9,
    )
    expected = patch.press(pressure * heights.size)
    scale = float(expected.max())
    np.testing.assert_allclose(contact.pressure, expected, atol=1e-5 * scale)
    decided = (expected > 1e-4 * scale) | (expected == 0) & (contact.gap > 1e-6)
    contact_set = contact.pressure > 0
    np.testing.assert_array_equal(contact_set[decided], (expected > 0)[decided])
    gap = patch.matrix @ expected.reshape(-1) - patch.below
    uniform = pressure * body.mean_compliance
    free = (expected > 1e-4 * scale) & (expected < (hardness or math.inf) * (1 - 1e-4))
    if free.any():
        delta = float(gap.reshape(shape)[free].mean())
        allowed = 1e-6 * (delta + scale / patch.compliances.min() ** -1)
        assert contact.delta - uniform == pytest.approx(delta, abs=allowed)


@dataclass(frozen=True)
class Graded(bem.Body):
    """A half-space whose modulus grows as exp(z / depth); it goes to `surface` at z = 0."""

    surface: HalfSpace
    depth: float

    @property
    def e_star(self):
        return self.surface.e_star

    def relative_compliance(self, wave_numbers):
        """Compute the ratio from Airy's functions exp(r z): r has a quartic equation."""
        ratios = [
            self._ratio(q, 1 / self.depth, self.surface.poisson)
            for q in wave_numbers.flat
        ]
        return np.reshape(ratios, wave_numbers.shape)

    @staticmethod
    def _ratio(q, grade, poisson):
        stiff, soft = 1 - poisson, poisson
        square = np.polymul([1, -grade], [1, -grade])
        quartic = np.polymul(square, [stiff, 0, soft * q**2])
        rest = [soft * q**2 - 2 * q**2, 2 * q**2 * grade, stiff * q**4]
        roots = np.roots(np.polyadd(quartic, rest))
        r = roots[np.argsort(roots.real)[:2]]
        # f(0) = 1 / q^2 and f'(0) = 0.
        first = -r[1] / (q**2 * (r[0] - r[1]))
        parts = first * np.array([1, -r[0] / r[1]])
        slopes = (r - grade) * (stiff * r**2 + soft * q**2) / q**2 - 2 * r
        normal = (parts * slopes).sum().real
        return normal * q / (2 * stiff)


def by_integration(wave_number, body):
    """Integrate plane strain of a graded body upwards from a depth where nothing moves.

    The state is the displacements along x and z and the stresses xz and zz, of which the first and
    the third go with sin(q x), the others with cos(q x).
    """
    poisson, modulus = body.surface.poisson, body.surface.modulus
    shear_ratio = 1 / (2 * (1 + poisson))
    lame_ratio = poisson / ((1 + poisson) * (1 - 2 * poisson))

    def rates(z, state):
        along, down, shear_stress, normal_stress = state
        young = modulus * math.exp(z / body.depth)
        shear, lame = shear_ratio * young, lame_ratio * young
        stretch = (normal_stress - lame * wave_number * along) / (lame + 2 * shear)
        lengthwise = lame * stretch + (lame + 2 * shear) * wave_number * along
        return (
            shear_stress / shear + wave_number * down,
            stretch,
            wave_number * lengthwise,
            -wave_number * shear_stress,
        )

    deep = 12 / wave_number
    ends = [
        solve_ivp(rates, (deep, 0), start, rtol=1e-10, atol=1e-30).y[:, -1]
        for start in ((0, 0, 1, 0), (0, 0, 0, 1))
    ]
    matrix = np.transpose(ends)
    parts = np.linalg.solve(matrix[2:], [0, -1])  # no shear stress, a pressure of 1 MPa
    return float(matrix[1] @ parts)


@pytest.mark.parametrize("wave_number", [0.2, 1.0, 5.0])
def test_the_compliance_of_a_graded_body_is_that_of_elasticity(wave_number):
    body = Graded(HalfSpace(2.0, 0.3), 3.0)
    compliance = float(body.compliance(np.array([wave_number]))[0])
    assert compliance == pytest.approx(by_integration(wave_number, body), rel=1e-6)


def test_a_graded_body_is_one_record():
    surface = HalfSpace(2.0, 0.3)
    nearly = Graded(surface, 1e4).relative_compliance(np.array([[0.5, 2.0]]))
    np.testing.assert_allclose(nearly, 1, atol=1e-3)
    body = Graded(surface, 3.0)
    assert body.relative_compliance(np.array([0.3]))[0] < 0.8  # stiffer below
    heights = rough(12, 2)
    contact = bem.solve(
        heights, 12.0, pressure=0.2, body=body, boundary="mirror", rtol=1e-9
    )
    patch = Patch(heights, (12.0, 12.0), "mirror", compliance=body.compliance)
    np.testing.assert_allclose(contact.pressure, patch.press(0.2 * 144), atol=1e-6)


@dataclass(frozen=True)
class TwiceAsCompliant(bem.Body):
    """A body that every wave displaces twice as far as a half-space."""

    e_star = 2.0

    def relative_compliance(self, wave_numbers):
        return np.full_like(wave_numbers, 2.0)


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
@pytest.mark.parametrize("load", [*LOADS, {"pressure": 20.0}])
def test_nothing_but_the_body_knows_its_compliance(boundary, load):
    """A compliance that stands anywhere else would be that of a half-space."""
    contact = solve(TwiceAsCompliant(), boundary, rtol=1e-10, **load)
    expected = solve(HalfSpace(1.0), boundary, rtol=1e-10, **load)
    largest = expected.largest_pressure
    np.testing.assert_allclose(contact.pressure, expected.pressure, atol=1e-6 * largest)
    np.testing.assert_allclose(contact.gap, expected.gap, atol=1e-7)
    np.testing.assert_allclose(contact.displacement, expected.displacement, atol=1e-7)
    assert contact.delta == pytest.approx(expected.delta, rel=1e-7)
    if math.isfinite(expected.stiffness):
        assert contact.stiffness == pytest.approx(expected.stiffness, rel=1e-6)


@pytest.mark.parametrize("boundary", ["free", "periodic", "mirror"])
def test_a_layer_passes_one_module_more_than_a_half_space_at_most(boundary):
    heights = rough(27, 5)  # of a size for which no other test has filled caches
    modules = []
    for body in (BASE, Layered(3.0, 3.0, 0.3, BASE)):
        names = set()

        def count(frame, event, _, names=names):
            module = frame.f_globals.get("__name__", "")
            if event == "call" and module.startswith("bem."):
                names.add(module)

        sys.setprofile(count)
        try:
            solve(body, boundary, heights, pressure=0.1)
        finally:
            sys.setprofile(None)
        modules.append(names)
    half_space, layer = modules
    assert len(layer - half_space) <= 1
    assert "bem.bodies" in layer


@pytest.mark.parametrize("thickness", [3.0, 0.3])
def test_the_area_of_layers_as_thin_as_a_cell_has_no_verdict(thickness):
    heights = rough(64, 3, power=4.0)
    body = Layered(thickness, 1.0, 0.3, HalfSpace(100.0))
    contact = bem.solve(heights, 64.0, pressure=0.02, body=body, boundary="periodic")
    assert contact.grid_error().resolved == (thickness > 1)
    if thickness < 1:
        assert "no smaller than the layer" in contact.grid_error().reason


def test_the_area_in_the_continuum_is_that_of_a_finer_grid():
    """The layer's material rules at the border where a cell is smaller than the layer."""
    body = Layered(3.0, 1.0, 0.3, HalfSpace(100.0))
    areas = []
    for nodes in (48, 192):
        places = 2 * np.pi / nodes * (np.arange(nodes) + 0.5)
        heights = np.add.outer(np.cos(places), np.cos(places))
        contact = bem.solve(heights, 48.0, pressure=0.02, body=body, boundary="periodic")
        areas.append(contact.continuum_area_percent)
    assert areas[0] == pytest.approx(areas[1], rel=0.01)


class Unhashed(TwiceAsCompliant):
    """A body that cannot be hashed, as one of a dataclass that is not frozen."""

    __hash__ = None


@dataclass(frozen=True)
class Powerless(TwiceAsCompliant):
    """A body with any modulus, whose compliance is not a number."""

    e_star: float = 1.0

    def relative_compliance(self, wave_numbers):
        return np.full_like(wave_numbers, np.nan)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"body": Unhashed()}, "Unhashed, which cannot be hashed"),
        ({"body": Powerless(0.0)}, "e_star of the Powerless = 0.0: must be above 0 MPa"),
        ({"body": (Powerless(np.nan), BASE)}, "e_star of the Powerless = nan"),
        ({"body": Powerless(), "boundary": "free"}, "compliance of the body = nan"),
        ({"body": 3.0}, "body = 3.0: must be a bem.HalfSpace"),
        ({"body": (BASE,)}, "must be a bem.HalfSpace"),
        ({"body": (BASE, ConcentratedForces(1.0))}, "must be a bem.HalfSpace"),
        ({"body": BASE, "modulus": 2.0}, "modulus = 2.0 beside a body"),
        ({"body": BASE, "poisson": 0.3}, "poisson = 0.3 beside a body"),
        ({"body": BASE, "kernel": "concentrated-force"}, "kernel = 'concentrated"),
        ({"body": BASE, "far_field": "compliant"}, "far_field = 'compliant' beside"),
        ({"body": Layered(1.0, 1e300, 0.3, BASE)}, "compliance of the body = "),
        ({"body": Layered(0.1, 1.0, 0.3, BASE), "boundary": "free"}, "too thin a layer"),
    ],
)
def test_bodies_that_are_refused(settings, words):
    with pytest.raises(ValueError, match=words) as refused:
        bem.solve(HEIGHTS, 32.0, 1.0, **{"boundary": "periodic"} | settings)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ((0.0, 1.0, 0.3, BASE), "thickness = 0.0: must be above 0 um"),
        ((1.0, -1.0, 0.3, BASE), "modulus = -1.0: must be above 0 MPa"),
        ((1.0, 1.0, 0.6, BASE), "poisson = 0.6: must be"),
        ((1.0, 1.0, 0.3, "soft"), "base = 'soft': must be a bem.HalfSpace or 'rigid'"),
        ((1.0, 1.0, 0.3, Layered(1.0, 1.0, 0.3, BASE)), "base = Layered"),
    ],
)
def test_layers_that_are_refused(numbers, words):
    with pytest.raises(ValueError, match=words):
        Layered(*numbers)


def test_a_layered_contact_has_no_conductance():
    contact = solve(Layered(1.0, 1.0, 0.3, BASE), pressure=0.1)
    with pytest.raises(ValueError, match="half-spaces only"):
        contact.conductance(1.0, 1.0)
    with pytest.raises(ValueError, match="half-spaces only"):
        contact.interface_conductance(1.0, 1.0)


@pytest.mark.long
def test_hard_layers_take_a_bounded_number_of_convolutions():
    base = HalfSpace(1.0, 0.3)
    body = Layered(2.0, 100.0, 0.3, base)
    on_layers = []
    on_half_spaces = []
    for seed in range(16):
        heights = rough(128, seed)
        slope = float(np.diff(heights, axis=0).std())
        share = 10 ** np.random.default_rng(seed).uniform(-0.3, 1.5)
        settings = {"pressure": share * slope, "boundary": "periodic"}
        contact = bem.solve(heights, 128.0, body=body, **settings)
        on_layers.append(contact.convolutions)
        settings["pressure"] /= body.modulus / base.modulus
        contact = bem.solve(heights, 128.0, body=base, **settings)
        on_half_spaces.append(contact.convolutions)
    assert np.median(on_layers) <= 150
    assert np.median(on_half_spaces) <= 15


@pytest.mark.parametrize("boundary", ["free", "periodic"])
@pytest.mark.parametrize(
    "loads", [{"pressures": [0.05, 0.1, 0.2, 0.3]}, {"deltas": [1, 2, 3, 3.5]}]
)
def test_a_ladder_on_a_layer_gives_what_single_solves_give(loads, boundary):
    ((quantity, values),) = loads.items()
    settings = {
        "body": Layered(4.0, 1.0, 0.3, "rigid"),
        "boundary": boundary,
        "rtol": 1e-9,
    }
    contacts = bem.ladder(HEIGHTS, 32.0, **loads, **settings)
    for value, contact in zip(values, contacts, strict=True):
        alone = bem.solve(HEIGHTS, 32.0, **{quantity[:-1]: value}, **settings)
        np.testing.assert_allclose(contact.pressure, alone.pressure, atol=1e-6)
        assert contact.delta == pytest.approx(alone.delta, rel=1e-7)
        again = pickle.loads(pickle.dumps(contact.problem))
        assert again.body == contact.problem.body


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.45])
def test_a_layer_on_a_rigid_base_is_that_of_contact_mechanics(poisson):
    """The other solver is installed by the extra `peers`."""
    package = pytest.importorskip("ContactMechanics")
    topography = pytest.importorskip("SurfaceTopography").Topography
    sides, thickness = (32.0, 32.0), 3.0
    substrate = package.PeriodicFFTElasticHalfSpace(
        (32, 32), 2.0, sides, thickness=thickness, poisson=poisson
    )
    surface = topography(HEIGHTS, physical_sizes=sides, periodic=True)
    system = package.Systems.NonSmoothContactSystem(substrate, surface)
    body = Layered(thickness, 2.0, poisson, "rigid")
    contact = solve(body, delta=1.5, rtol=1e-12)
    result = system.minimize_proxy(
        offset=1.5 - HEIGHTS.max(), pentol=1e-12, forcetol=np.inf, maxiter=1000
    )
    assert result.success
    np.testing.assert_allclose(
        result.jac, contact.pressure, atol=1e-6 * contact.largest_pressure
    )
    assert result.jac.sum() == pytest.approx(contact.force, rel=1e-6)
