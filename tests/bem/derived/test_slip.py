"""Partial slip, against Cattaneo and Mindlin, and a vector solve of Coulomb's law."""

from dataclasses import dataclass

import numpy as np
import pytest

import bem
from bem.derived.slip import (
    isotropic_ratio,
    partial_slip,
    shear_patch_stiffness,
    shear_stiffness,
)

SIDE = 1000.0  # [um]
NU = 0.3
FRICTION = 0.3
SHARES = np.array([0.2, 0.5, 0.8, 0.95])  # of the force at which the bodies slide


def rough(shape, seed=0, stretch=1.0):
    """Return a smooth random surface that repeats itself, with an rms height of 1 um.

    Waves along x are longer than those along y by `stretch`.
    """
    random = np.random.default_rng(seed)
    along = np.fft.fftfreq(shape[0])[:, np.newaxis] * shape[0] * stretch
    across = np.fft.rfftfreq(shape[1]) * shape[1]
    waves = np.hypot(along, across)
    amplitude = np.where(
        (waves >= 2) & (waves < min(shape) / 8), np.maximum(waves, 1) ** -1.8, 0
    )
    phases = np.exp(2j * np.pi * random.random(waves.shape))
    heights = np.fft.irfft2(amplitude * phases, s=shape)
    return heights / heights.std()


@dataclass(frozen=True)
class Sphere:
    """A sphere on a half-space of like constants, with Mindlin's answers, in E = 1 MPa."""

    nodes: int
    depth: float  # [um]
    radius: float = 50_000.0  # [um]

    @classmethod
    def resolved(cls, nodes_in_radius):
        """Return a sphere whose contact has a number of nodes in its radius, on a fine patch."""
        spacing = 1 / (6 * nodes_in_radius)
        radius_of_contact = nodes_in_radius * spacing * SIDE
        return cls(nodes=6 * nodes_in_radius + 1, depth=radius_of_contact**2 / cls.radius)

    @property
    def contact(self):
        """The contact of the sphere."""
        x = (np.arange(self.nodes) - self.nodes // 2) * SIDE / (self.nodes - 1)
        heights = -(x[:, np.newaxis] ** 2 + x**2) / (2 * self.radius)
        return bem.solve(heights, SIDE, self.depth, poisson=NU)

    @property
    def stiffness(self):
        """Mindlin's stiffness at first, 8 G a / (2 - nu) with 1 / G for one body."""
        return isotropic_ratio(NU) * 2 * np.sqrt(self.radius * self.depth) / (1 - NU**2)

    def shift(self, sliding, shares):
        """Mindlin's shift under shares of the force at which the bodies slide [um]."""
        return 1.5 * sliding / self.stiffness * (1 - (1 - shares) ** (2 / 3))

    def loss(self, sliding, shares):
        """Mindlin's loss of a cycle (Johnson 1985, equation 7.57) [pJ]."""
        left = 1 - shares
        bracket = 1 - left ** (5 / 3) - 5 / 6 * shares * (1 + left ** (2 / 3))
        return 36 / 5 * sliding**2 / self.stiffness * bracket


@pytest.mark.parametrize(
    ("sphere", "shift", "area", "loss"),
    [
        (Sphere.resolved(10), 2e-3, 0.02, 0.2),
        pytest.param(Sphere.resolved(60), 2e-4, 5e-3, 0.01, marks=pytest.mark.long),
    ],
    ids=["10 nodes in the radius", "60 nodes in the radius"],
)
@pytest.mark.parametrize("axis", [0, 1])
def test_spheres_slip_as_cattaneo_and_mindlin_say(sphere, shift, area, loss, axis):
    contact = sphere.contact
    sliding = FRICTION * contact.force
    slip = partial_slip(contact, FRICTION, SHARES * sliding, poisson=NU, axis=axis)
    expected = sphere.shift(sliding, SHARES)
    np.testing.assert_allclose(slip.shift, expected, rtol=shift)
    sticking = slip.stick_percent / contact.continuum_area_percent
    np.testing.assert_allclose(sticking, (1 - SHARES) ** (2 / 3), atol=area)
    np.testing.assert_allclose(slip.loss, sphere.loss(sliding, SHARES), rtol=loss)


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_little_shear_shifts_spheres_as_mindlin_says(share):
    """Few nodes leave the sticking contact, so that both displacements differ by little."""
    sphere = Sphere(nodes=129, depth=0.6)
    contact = sphere.contact
    sliding = FRICTION * contact.force
    slip = partial_slip(contact, FRICTION, share * sliding, poisson=NU)
    assert slip.shift[0] == pytest.approx(sphere.shift(sliding, share), rel=4e-3)


def test_loss_is_the_area_of_the_closed_loop():
    contact = Sphere(nodes=129, depth=0.6).contact
    largest = 0.9 * FRICTION * contact.force
    fine = np.linspace(0, largest, 60)
    slip = partial_slip(contact, FRICTION, fine, poisson=NU)
    # Masing: a branch of the loop is the first curve, doubled.
    under_first_curve = np.trapezoid(slip.shears, slip.shift)
    loop = 8 * (under_first_curve - slip.shears[-1] * slip.shift[-1] / 2)
    assert slip.loss[-1] == pytest.approx(loop, rel=2e-3)


def test_the_tangent_stiffness_is_the_slope_of_the_curve():
    contact = bem.solve(rough((48, 48)), SIDE, pressure=5e-3, boundary="periodic")
    middle = 0.5 * FRICTION * contact.force
    shears = middle * np.array([0.999, 1.0, 1.001])
    slip = partial_slip(contact, FRICTION, shears, poisson=NU)
    slope = (shears[2] - shears[0]) / (slip.shift[2] - slip.shift[0])
    assert slip.stiffness[1] == pytest.approx(slope, rel=0.01)
    assert slip.first_stiffness > slip.stiffness[1]


def test_nothing_slips_without_shear():
    contact = bem.solve(rough((32, 32)), SIDE, pressure=5e-3, boundary="periodic")
    slip = partial_slip(contact, FRICTION, 0.0, poisson=NU)
    assert slip.shift[0] == 0
    assert slip.loss[0] == 0
    assert slip.stiffness[0] == pytest.approx(slip.first_stiffness)
    assert slip.stick_percent[0] == contact.continuum_area_percent


@pytest.mark.parametrize("boundary", ["free", "periodic", "mirror"])
def test_without_lateral_strain_the_traction_obeys_coulombs_law_exactly(boundary):
    heights = rough((27, 27), seed=2)
    settings = {"boundary": boundary, "rtol": 1e-12}
    contact = bem.solve(heights, SIDE, pressure=5e-3, **settings)
    shear = 0.6 * FRICTION * contact.force
    slip = partial_slip(contact, FRICTION, shear, poisson=0.0)
    stuck = bem.solve(heights, SIDE, force=0.4 * contact.force, **settings)
    traction = FRICTION * (contact.pressure - stuck.pressure)
    displacement = FRICTION * (contact.displacement - stuck.displacement)
    sticks = stuck.pressure > 0
    slips = (contact.pressure > 0) & ~sticks
    shift = slip.shift[0]
    cell = contact.problem.spacing[0] * contact.problem.spacing[1]
    assert traction.sum() * cell == pytest.approx(shear, rel=1e-8)
    np.testing.assert_allclose(displacement[sticks], shift, rtol=1e-8)
    assert (displacement[slips] <= shift * (1 + 1e-8)).all()
    assert (traction >= 0).all()


def vector_matrix(shape, nodes, poisson):
    """Return the matrix (2a, 2a) of displacements along x and y by tractions along x and y.

    It is that of the a nodes of a periodic patch of square cells with an odd number of nodes.
    """
    along = 2 * np.pi * np.fft.fftfreq(shape[0])[:, np.newaxis]
    across = 2 * np.pi * np.fft.fftfreq(shape[1])
    wave = np.hypot(along, across)
    wave[0, 0] = np.inf
    blocks = []
    for first, second, same in (
        (along, along, 1),
        (along, across, 0),
        (across, across, 1),
    ):
        spectrum = 2 / wave * (same - poisson * first * second / wave**2) / (1 - poisson)
        blocks.append(np.fft.ifft2(spectrum).real)
    rows, columns = np.divmod(nodes, shape[1])
    down = np.subtract.outer(rows, rows) % shape[0]
    right = np.subtract.outer(columns, columns) % shape[1]
    xx, xy, yy = (block[down, right] for block in blocks)
    return np.block([[xx, xy], [xy, yy]])


def coulomb_force(contact, shift, axis, poisson):
    """Return the shear force of a shift by a vector solve of Coulomb's law [uN].

    Tractions of at most friction times the pressure minimise the energy, by accelerated projected
    gradients (Nesterov's method with restarts).
    """
    spacing = contact.problem.spacing[0]
    nodes = np.flatnonzero(contact.pressure > 0)
    limit = FRICTION * contact.pressure.ravel()[nodes]
    matrix = vector_matrix(contact.pressure.shape, nodes, poisson)
    given = np.zeros((2, nodes.size))
    given[axis] = shift / spacing
    step = 1 / np.linalg.eigvalsh(matrix)[-1]
    traction = np.zeros((2, nodes.size))
    ahead, momentum = traction, 1.0
    for _ in range(20_000):
        slope = (matrix @ ahead.ravel()).reshape(2, -1) - given
        forward = ahead - step * slope
        size = np.maximum(np.hypot(*forward), 1e-300)
        forward = forward * np.minimum(1, limit / size)
        change = forward - traction
        if np.abs(change).max() < 1e-9 * limit.max():
            break
        following = (1 + np.sqrt(1 + 4 * momentum**2)) / 2
        if (slope * change).sum() > 0:  # uphill: restart
            following, ahead = 1.0, forward
        else:
            ahead = forward + (momentum - 1) / following * change
        traction, momentum = forward, following
    return traction[axis].sum() * spacing**2


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("stretch", [1.0, 3.0], ids=["isotropic", "ridges"])
@pytest.mark.parametrize("axis", [0, 1])
def test_shear_forces_are_those_of_coulombs_law(seed, stretch, axis):
    """Within 2 % in the force at nu = 0.3, on 20 rough surfaces."""
    heights = rough((41, 41), seed, stretch)
    contact = bem.solve(heights, SIDE, pressure=2e-3, boundary="periodic")
    shears = np.array([0.3, 0.8]) * FRICTION * contact.force
    slip = partial_slip(contact, FRICTION, shears, poisson=NU, axis=axis)
    forces = [coulomb_force(contact, shift, axis, NU) for shift in slip.shift]
    np.testing.assert_allclose(forces, shears, rtol=0.02)


@pytest.mark.parametrize("boundary", ["free", "periodic", "mirror"])
def test_isotropic_contacts_have_mindlins_ratio(boundary):
    heights = rough((64, 64), seed=1)
    contact = bem.solve(heights, SIDE, pressure=2e-3, boundary=boundary)
    for axis in (0, 1):
        ratio = shear_stiffness(contact, NU, axis) / contact.stiffness
        assert ratio == pytest.approx(isotropic_ratio(NU), rel=0.02)


def test_ridges_are_softer_across_the_shear():
    """A strip under shear along it has 1 - nu of its normal stiffness; across it has the whole."""
    x = np.arange(48) / 48
    heights = np.repeat(np.cos(2 * np.pi * x)[np.newaxis], 48, axis=0)  # ridges along x
    contact = bem.solve(heights, SIDE, pressure=1e-4, boundary="periodic")
    along = shear_stiffness(contact, NU, 0) / contact.stiffness
    across = shear_stiffness(contact, NU, 1) / contact.stiffness
    assert along == pytest.approx(1 - NU, rel=1e-6)
    assert across == pytest.approx(1, rel=1e-6)


def test_the_patch_in_shear_is_a_full_contact():
    heights = np.zeros((15, 18))
    heights[3, 4] = 1e-9
    contact = bem.solve(heights, (SIDE, SIDE), 1.0)
    assert contact.area_percent == 100
    for axis in (0, 1):
        expected = shear_stiffness(contact, NU, axis)
        patch = shear_patch_stiffness(contact.problem, NU, axis)
        assert patch == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"hardness": 0.05},
            "hardness = 0.05 MPa: partial slip is that of elastic bodies",
        ),
        ({"far_field": "compliant"}, "partial slip needs"),
        ({"kernel": "concentrated-force"}, "partial slip needs"),
    ],
)
def test_other_contacts_are_refused(settings, message):
    contact = bem.solve(rough((17, 17)), SIDE, pressure=1e-3, **settings)
    with pytest.raises(ValueError, match=message):
        partial_slip(contact, FRICTION, 0.0, poisson=NU)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"friction": 0.0}, "friction = 0.0: must be above 0"),
        ({"poisson": 0.6}, "poisson = 0.6: must be above -1 and at most 0.5"),
        ({"axis": 2}, "axis = 2: must be 0 for x or 1 for y"),
        ({"shears": -1.0}, "a shear force is -1 uN: it must be at least 0 and below"),
        ({"shears": 1e9}, "at which the bodies slide"),
        ({"shears": [[1.0]]}, "a row of forces is needed"),
    ],
)
def test_wrong_arguments_are_refused(arguments, message):
    contact = bem.solve(rough((17, 17)), SIDE, pressure=1e-3)
    given = {"friction": FRICTION, "shears": 0.0, "poisson": NU, "axis": 0, **arguments}
    friction, shears = given.pop("friction"), given.pop("shears")
    with pytest.raises(ValueError, match=message):
        partial_slip(contact, friction, shears, **given)


def test_a_layer_is_refused():
    body = bem.Layered(thickness=50.0, modulus=0.3, poisson=0.3, base="rigid")
    heights = rough((17, 17))
    contact = bem.solve(heights, SIDE, pressure=1e-3, boundary="periodic", body=body)
    with pytest.raises(ValueError, match="a layered body has"):
        partial_slip(contact, FRICTION, 0.0, poisson=NU)


def test_bodies_apart_are_refused():
    contact = bem.solve(rough((17, 17)), SIDE, -1.0)
    with pytest.raises(ValueError, match="the normal load is 0"):
        partial_slip(contact, FRICTION, 0.0, poisson=NU)


def test_full_contact_without_edges_is_refused():
    contact = bem.solve(rough((17, 17)), SIDE, pressure=10.0, boundary="periodic")
    with pytest.raises(ValueError, match="the contact is full and infinitely stiff"):
        partial_slip(contact, FRICTION, 0.0, poisson=NU)
