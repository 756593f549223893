"""`gen contact`: solve contact problems of one surface."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from gen import options
from gen.commands.bodies import Against, second_body
from gen.commands.pictures import empty_figure
from gen.maps.settings import Reading
from gen.runtime.command_line import grouped
from gen.runtime.files import Output, check_outputs


class Loads(NamedTuple):
    """The load, of which one is given.

    Attributes
    ----------
    delta, force, pressure : str
        Values, see `gen.maps.contacts.chosen_load` [um], [uN], [MPa]; "" if it is not given.
    """

    delta: options.Delta = ""
    force: options.NormalForce = ""
    pressure: options.Pressure = ""


class Solving(NamedTuple):
    """How the problems are solved, see `bem.solve`.

    Attributes
    ----------
    kernel, far_field : str
        Influence of a node, and what holds the body far away.
    rtol : float
        Residual to reach, divided by Delta [1].
    max_iterations : int
        Bound on the iterations.
    """

    kernel: options.Kernel = "uniform-pressure"
    far_field: options.FarField = "rigid"
    rtol: options.Tolerance = 2e-7
    max_iterations: options.MaxIterations = 1000


class Files(NamedTuple):
    """Files to write, each None if it is not asked for.

    Attributes
    ----------
    table, picture, flattened : Path or None
        Table (CSV), picture, and the heights that the last load leaves (.npy).
    """

    table: options.Table = None
    picture: options.Picture = None
    flattened: options.Flattened = None

    def empty_figure(self, inputs: Sequence[Path | str]) -> Any:
        """Return the figure to draw into, or None; refuse outputs before anything is solved.

        Parameters
        ----------
        inputs : sequence of Path or str
            Files that are read, which no output may replace.

        Raises
        ------
        InputError
            If an output cannot be written.
        """
        outputs = [
            Output(self.table, "--csv"),
            Output(self.picture, "--plot", "picture"),
            Output(self.flattened, "--flattened", "heights"),
        ]
        check_outputs(outputs, inputs)
        return empty_figure(self.picture, 11, 8.2)


@grouped
def contact(
    surface: options.SurfaceFile,
    *,
    loads: Loads,
    young: options.Young = None,
    poisson: options.Poisson = None,
    e_star: options.EStar = None,
    hardness: options.Hardness = None,
    reading: Reading,
    facing: Against,
    boundary: options.Boundary = "free",
    solving: Solving,
    spots: options.Spots = False,
    stiffness: options.Stiffness = False,
    conductivity: options.Conductivity = None,
    threads: options.Threads = None,
    files: Files,
) -> None:
    """Solve contact problems of one surface: area, force, pressure, gap, yielding, residual.

    With --spots, --stiffness and --conductivity also spots, stiffness and conductance.

    Give one of --delta, --force and --pressure: a number, or for a law start:stop:count, with :log
    for an even ratio, or several numbers with commas.
    """
    from bem.workers import cores, default_threads, on_threads
    from gen.display.contacts import follow_contacts
    from gen.maps.bodies import surface_of
    from gen.maps.contacts import (
        Wanted,
        chosen_load,
        contact_row,
        require_conductivities,
        require_yielding,
        solve_loads,
        write_flattened,
    )
    from gen.maps.doubts import surface_warnings
    from gen.material import Bodies
    from gen.runtime.documents import write_csv

    load, values = chosen_load(loads._asdict())
    require_yielding(files.flattened, hardness)
    wanted = Wanted(spots, stiffness, require_conductivities(conductivity or []))
    figure = files.empty_figure(facing.with_first(surface))
    bodies = Bodies.of_options(young or [], poisson or [], e_star, hardness)
    topography = surface_of(surface, reading, second_body(reading, facing), boundary)
    with on_threads(threads or default_threads(cores())):
        contacts, warnings = follow_contacts(
            topography,
            [*bodies.doubts, *surface_warnings(topography)],
            solve_loads(
                topography,
                load,
                values,
                modulus=bodies.e_star,
                hardness=bodies.hardness,
                **solving._asdict(),
            ),
            len(values),
            wanted=wanted,
            material=bodies.known,
        )
    if files.table is not None:
        rows = [contact_row(topography, each, warnings, wanted) for each in contacts]
        write_csv(files.table, rows)
    if files.flattened is not None:
        write_flattened(files.flattened, contacts, len(values))
    if files.picture is not None:
        from gen.maps.contact_picture import Subject, draw_contacts

        subject = Subject(topography.name, load, bodies.known, warnings, spots=spots)
        draw_contacts(figure, contacts, subject, files.picture)
