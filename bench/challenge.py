"""The surface and the load of the contact-mechanics challenge, without its adhesion.

The challenge [1]_ [2]_ presses a rough, periodic indenter against an elastic half-space. Its
roughness is self-affine, with a roll-off and a shortest wave, and it has a short-ranged adhesion.
This report leaves the adhesion out, because contacts of this project have none. Its answers are
therefore no predictions of the published ones, and no published ones stand beside them. Surface,
modulus and pressure are those of [1]_, but the phases of the waves are our own, unless the user has
the map of the challenge.

References
----------
.. [1] M. H. Mueser, W. B. Dapp, The contact-mechanics challenge: problem definition,
   arXiv:1512.02403, 2015.
.. [2] M. H. Mueser and others, Meeting the contact-mechanics challenge, Tribology Letters 65, 118,
   2017.
"""

import time
import tracemalloc
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import bem
from bench.files import Row
from bench.report import Report, remark
from gen.arrays import Heights
from gen.maps.read import read
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from gen.self_affine import SelfAffineSpectrum
from gen.spectral import generate_spectral
from gen.statistics import rms_slope

SIDE = 100.0
"""Period of the surface along both axes [um]."""

SPECTRUM = SelfAffineSpectrum(hurst=0.8, roll_off=20.0, cut_off=0.1)
"""Power spectrum of the surface: Hurst exponent [1], roll-off and shortest wave [um]."""

SLOPE = 1.0
"""Rms slope of the surface [1]."""

E_STAR = 25.0
"""Plane-strain modulus E* of the half-space [MPa]."""

PRESSURE = 0.25
"""Nominal pressure [MPa]."""

LEAST_NODES = 16
"""Smallest number of nodes a side of a grid. The roll-off wave has three nodes on it."""

MOST_NODES = 16_384
"""Largest number of nodes a side of a grid. Each field of it takes 2.1 GB."""

BYTES_OF_MB = 1e6
"""Bytes of a megabyte."""

TEXT = """\
Without adhesion: the published answers of the challenge include it, and are no reference for these.
"""


@dataclass(frozen=True)
class Answers:
    """Answers of one grid, and what they cost."""

    nodes: int  # nodes a side of the grid
    slope: float  # rms slope between its nodes [1]
    contact: bem.Contact  # the contact under `PRESSURE`
    seconds: float  # processor time of its solve [s]
    memory: float  # largest memory of the solve at any time, without the heights [bytes]

    def row(self, coarse: bem.Contact | None) -> Row:
        """Return the answers with their bars as a row of the table.

        Parameters
        ----------
        coarse : bem.Contact or None
            The contact on half of the nodes a side; it is solved if it is None.

        Returns
        -------
        Row
            The answers by the names of the columns. The stiffness is that of the nominal area
            [MPa / um].
        """
        contact = self.contact
        error = contact.grid_error(coarse)
        area = SIDE**2  # nominal area [um2]
        return {
            "nodes": self.nodes,
            "nodes_a_wave": SPECTRUM.cut_off * self.nodes / SIDE,
            "rms_slope": self.slope,
            "continuum_percent": contact.continuum_area_percent,
            "continuum_bar_percent": error.area_percent,
            "count_percent": contact.area_percent,
            "mean_gap_um": contact.mean_gap,
            "mean_gap_bar_um": error.mean_gap,
            "stiffness_per_area": contact.stiffness / area,
            "stiffness_per_area_bar": error.stiffness / area,
            "bars_hold": "yes" if error.resolved else "no",
            "convolutions": contact.convolutions,
            "cpu_seconds": self.seconds,
            "memory_MB": self.memory / BYTES_OF_MB,
        }


def challenge(
    nodes: Sequence[int], surface: Path | None = None, unit: str = "", seed: int = 1
) -> Report:
    """Press the surface of the challenge on several grids, and measure answers and cost.

    The coarser grids have every second, fourth ... node of the finest one. Prints the progress on
    standard error.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side of the grids, each a divisor of the nodes of the surface.
    surface : Path, optional
        The map of the challenge, with `SIDE` a side. By default a surface with the same spectrum is
        made.
    unit : str
        Unit of the heights of the map; "" for that of the file, or um if it names none.
    seed : int
        Seed of the phases of the surface that is made.

    Returns
    -------
    Report
        Table `challenge`, with a row for each grid, the coarsest one first.

    Raises
    ------
    InputError
        If a grid is not one of the surface, or the map cannot be read, is not square, or has holes.
    """
    grids = sorted(set(nodes))
    for size in grids:
        if not LEAST_NODES <= size <= MOST_NODES:
            raise InputError(
                f"nodes {size}: give {LEAST_NODES} to {MOST_NODES:,} nodes a side"
            )
    if not grids:
        raise InputError("nodes: give at least one number of nodes a side")
    if surface is None:
        made_nodes = nodes_of_made_surface(grids[-1])
        _require_divisors(grids, made_nodes, "the surface is made on")
        heights = made_surface(made_nodes, seed)
    else:
        heights = read_surface(surface, unit)
        _require_divisors(grids, len(heights), f"{surface} has")
    rows: list[Row] = []
    coarse: bem.Contact | None = None
    for answers in _answers(heights, grids):
        # The bars compare with half of the nodes a side.
        has_half = coarse is not None and 2 * coarse.pressure.shape[0] == answers.nodes
        rows.append(answers.row(coarse if has_half else None))
        coarse = answers.contact
        remark(
            f"{answers.nodes} nodes: {rows[-1]['continuum_percent']:.3g} %,"
            f" {answers.seconds:.1f} s"
        )
    return Report({"challenge": rows}, text=TEXT)


def _require_divisors(grids: Sequence[int], nodes: int, place: str) -> None:
    """Raise InputError unless every grid has every k-th node of a surface with `nodes` a side.

    `place` says whose nodes these are.
    """
    for size in grids:
        if nodes % size:
            raise InputError(f"nodes {size}: {place} {nodes} a side; give its divisors")


def nodes_of_made_surface(finest: int) -> int:
    """Return the nodes a side on which the surface is made.

    Parameters
    ----------
    finest : int
        Nodes a side of the finest grid.

    Returns
    -------
    int
        `finest`, doubled until the shortest wave has more than two nodes.
    """
    nodes = finest
    while SPECTRUM.cut_off * nodes <= 2 * SIDE:
        nodes *= 2
    return nodes


def made_surface(nodes: int, seed: int) -> Heights:
    """Make a surface with the spectrum of the challenge, and phases of our own.

    Parameters
    ----------
    nodes : int
        Nodes a side, more than two in the shortest wave.
    seed : int
        Seed of the phases. The surface is the same on all grids.

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights [um].
    """
    random = np.random.default_rng(seed)
    return generate_spectral((nodes, nodes), SIDE, SPECTRUM, random, rms_slope=SLOPE)


def read_surface(path: Path, unit: str) -> Heights:
    """Read the map of the challenge.

    Parameters
    ----------
    path : Path
        Map of `SIDE` a side: .npy, text, or an instrument's file.
    unit : str
        Unit of its heights; "" for that of the file, or um if it names none.

    Returns
    -------
    ndarray, shape (n, n)
        Heights [um]. High nodes are those that touch first.

    Raises
    ------
    InputError
        If it cannot be read, is not square, or lacks heights.
    """
    reading = Reading(side=f"{SIDE:g},{SIDE:g}", unit=unit)
    topography = read(path, reading, "periodic")
    for warning in topography.warnings:
        remark(f"warning: {warning}")
    nx, ny = topography.heights.shape
    if nx != ny:
        raise InputError(f"{path}: {nx} x {ny} nodes; the map of the challenge is square")
    if topography.missing:
        raise InputError(
            f"{path}: nodes without a height: {topography.missing}; the map of the challenge has"
            " none"
        )
    return topography.heights


def _answers(heights: Heights, grids: Sequence[int]) -> Iterator[Answers]:
    """Solve the contact on each of some grids, the coarsest one first."""
    for size in grids:
        step = len(heights) // size
        sampled = np.ascontiguousarray(heights[::step, ::step])
        tracemalloc.start()
        began = time.process_time()
        try:
            contact = bem.solve(
                sampled, SIDE, pressure=PRESSURE, modulus=E_STAR, boundary="periodic"
            )
            seconds = time.process_time() - began
            _, memory = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        spacing = SIDE / size
        yield Answers(
            nodes=size,
            slope=float(rms_slope(sampled, (spacing, spacing))),
            contact=contact,
            seconds=seconds,
            memory=memory,
        )
