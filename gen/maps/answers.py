"""Answers about a solved contact: the lines of a report, and the cells of a table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, NamedTuple

from gen.maps import accuracy
from gen.maps.limits import NODES_A_WAVE, MapLimits
from gen.material import LAYER_COLUMNS, columns_of_layer, require_within
from gen.quantities import (
    CONDUCTANCE,
    CONTINUUM,
    MEAN_GAP,
    QUANTITIES,
    SIDES,
    Media,
    Quantity,
    nominal_area,
    unit_in_names,
)
from gen.runtime.errors import InputError
from gen.shear import Sheared
from gen.units import Unit

if TYPE_CHECKING:
    from bem import Body, Contact
    from bem.budget import ErrorParts
    from gen.material import Friction


@dataclass(frozen=True)
class AnswerOptions:
    """Options of `gen contact` that add answers to those that are always given.

    Each field but `errors` and `shares` has the name of a `gen.quantities.Quantity.option`; an
    option that is set adds the answers about the quantities with this option.
    """

    # whether to estimate the area in the continuum and the error of the grid
    grid_error: bool = False
    spots: bool = False  # whether to count the spots of contact
    flow: bool = False  # whether to solve the flow through the gap along x and along y
    stiffness: bool = False  # whether to solve for the stiffness
    # thermal conductivities of the first and of the second body [W/(m K)], with which the
    # conductance is computed; None for no conductance
    conductivities: tuple[float, float] | None = None
    # friction of bodies of like elastic constants, with which shear is computed; None for no shear
    friction: Friction | None = None
    # shear forces over the force at which the bodies slide [1], for which the slip is computed
    shares: tuple[float, ...] = ()
    # Largest relative errors of answers, by their names in `bem.answers.ANSWERS` [1], for which
    # contacts are solved on the coarsest grid that gives them; None for the grid of the map.
    errors: Mapping[str, float] | None = None

    @property
    def names(self) -> list[str]:
        """Names of the options whose quantities are shown, "always" first, in their order."""
        chosen = [field.name for field in fields(self) if getattr(self, field.name)]
        return ["always", *chosen]


class Answer(NamedTuple):
    """A number or word about a contact: a line of a report, and a cell of a table."""

    column: str  # name of the column in tables
    value: float | int | str  # the answer, a number in `unit`; "" if it is not known
    label: str  # name for people
    unit: str  # unit for people, followed by a remark if the answer needs one; "" for neither
    # Error of the value, in `unit`. The text for people ends at the second digit of the error, or
    # has six digits if the error is 0 or infinite.
    error: float = 0.0
    is_detail: bool = False  # whether only files have it, because another line states it

    @property
    def shown(self) -> str:
        """The value as text for people, "-" if it is not known."""
        if not isinstance(self.value, float):
            return str(self.value) or "-"
        if not 0 < self.error < math.inf:
            return f"{self.value:.6g}"
        place_of_first_digit = math.floor(math.log10(self.error))
        decimals = max(1 - place_of_first_digit, 0)
        return f"{self.value:.{decimals}f}"

    @property
    def unit_alone(self) -> str:
        """The unit without a remark."""
        return self.unit.partition(",")[0]

    def in_unit(self, unit: Unit) -> Answer:
        """Return the same answer in another unit.

        Parameters
        ----------
        unit : Unit
            Unit of the same quantity. The end of the column's name becomes its name.

        Returns
        -------
        Answer
            The answer in this unit: value, error, unit and column are changed. An answer that is
            text or not known, or has this unit, is returned as it is.
        """
        if not isinstance(self.value, float) or unit.name == self.unit_alone:
            return self
        old_ending = unit_in_names(self.unit_alone)
        new_ending = unit_in_names(unit.name)
        return self._replace(
            column=self.column.removesuffix(old_ending) + new_ending,
            value=self.value / unit.size,
            unit=unit.name + self.unit.removeprefix(self.unit_alone),
            error=self.error / unit.size,
        )


def require_conductivities(conductivities: Sequence[float]) -> tuple[float, float]:
    """Check the thermal conductivities of both bodies, and return one for each body.

    Parameters
    ----------
    conductivities : sequence of float
        Values of the option --conductivity, at least one: one for both bodies, or one for each
        [W/(m K)].

    Returns
    -------
    tuple of float
        Conductivities of the first and of the second body [W/(m K)].

    Raises
    ------
    InputError
        If there are more than two, or a value is outside the range of physical numbers.
    """
    if len(conductivities) > 2:
        raise InputError(
            f"--conductivity was given {len(conductivities)} times: give it once or twice"
        )
    for conductivity in conductivities:
        require_within("--conductivity", conductivity, "W/(m K)")
    return conductivities[0], conductivities[-1]


def answers(
    contact: Contact, options: AnswerOptions, limits: MapLimits | None = None
) -> list[Answer]:
    """List the answers about a solved contact.

    Some options need further solutions (as of linear systems, or of flow), which are computed here.

    Parameters
    ----------
    contact : bem.Contact
        A solved contact.
    options : AnswerOptions
        Answers besides those that are always given.
    limits : MapLimits, optional
        Limits of the map, which belong to errors that are asked for.

    Returns
    -------
    list of Answer
        One for each cell of a table: quantities by option, with E*, boundary and hardness after
        those that are always given, then the grid and the errors that were asked for and the
        limits of the map, if any, and the residual last.

    Raises
    ------
    InputError
        If a linear solve, or the flow through the gap, does not converge; or if a contact that is
        full and has no edges is sheared.
    """
    media = Media(options.conductivities, friction=options.friction)
    answers_of_contact: list[Answer] = []
    try:
        for option in options.names:
            answers_of_contact += _answers_of_option(option, contact, media)
            if option == "always":
                answers_of_contact += _about_the_bodies(contact)
        if options.conductivities is not None:
            answers_of_contact.append(_conductance_per_area(contact, media))
        if options.friction is not None and options.shares:
            answers_of_contact += _about_the_slip(
                contact, options.friction, options.shares
            )
        if options.errors is not None:
            answers_of_contact += _about_the_grid(contact)
            answers_of_contact += _about_the_errors(contact, options.errors)
        if limits is not None:
            answers_of_contact += _about_the_limits(limits)
    except (ArithmeticError, ValueError) as error:
        raise InputError(str(error)) from None
    residual = Answer(
        column="residual",
        value=contact.residual,
        label="residual",
        unit="of Delta",
    )
    answers_of_contact.append(residual)
    return answers_of_contact


def _answers_of_option(option: str, contact: Contact, media: Media) -> list[Answer]:
    """Return the answers about all quantities with an option, as "always" or "spots".

    Quantities that need a hardness are left out if the bodies are elastic.
    """
    elastic = contact.problem.hardness is None
    answers_of_option: list[Answer] = []
    for quantity in QUANTITIES.values():
        if quantity.option != option:
            continue
        if quantity.needs_hardness and elastic:
            continue
        answers_of_option += _answers_of_quantity(quantity, contact, media)
    return answers_of_option


def _about_the_bodies(contact: Contact) -> list[Answer]:
    """Return the answers about E*, a layer, the boundary unless it is free, and the hardness."""
    problem = contact.problem
    modulus = Answer(
        column="modulus_MPa",
        value=problem.modulus,
        label="modulus E*",
        unit="MPa",
    )
    about_the_bodies = [modulus, *_about_the_layer(problem.body)]
    if problem.boundary != "free":
        boundary = Answer(
            column="boundary",
            value=problem.boundary,
            label="boundary",
            unit="",
        )
        about_the_bodies.append(boundary)
    if problem.hardness is not None:
        hardness = Answer(
            column="hardness_MPa",
            value=problem.hardness,
            label="hardness",
            unit="MPa",
        )
        about_the_bodies.append(hardness)
    return about_the_bodies


def _about_the_layer(body: Body) -> list[Answer]:
    """Return the answers about the layer of a body and about its base; none for half-spaces."""
    answers_about_it: list[Answer] = []
    for column, number in columns_of_layer(body).items():
        heading = LAYER_COLUMNS[column]
        answers_about_it.append(Answer(column, number, heading.label, heading.unit))
    return answers_about_it


def _answers_of_quantity(
    quantity: Quantity, contact: Contact, media: Media
) -> list[Answer]:
    """Return the answer about a quantity as a list (of three for the area in the continuum)."""
    value = quantity.of(contact, media)
    if quantity is MEAN_GAP and contact.contact_nodes == contact.pressure.size:
        value = 0.0  # full contact leaves no gap: the mean is rounding, some 1e-16 um
    if quantity.code:
        value = _sides_in_words(int(value))
    if quantity is CONTINUUM:
        return _about_the_continuum(contact, value)
    words = []
    if quantity.unit != "1":
        words.append(quantity.unit)
    remark = _remark(quantity, contact)
    if remark:
        words.append(remark)
    separator = " " if quantity.unit == "%" else ", "
    answer = Answer(
        column=quantity.in_tables,
        value=value,
        label=quantity.noun,
        unit=separator.join(words),
    )
    return [answer]


def _sides_in_words(code: int) -> str:
    """Return the axes whose opposite sides are connected, as "x and y", "x", "y" or "no".

    The code is a sum of the numbers of `gen.quantities.SIDES`.
    """
    axes = [axis for axis, side in zip("xy", SIDES, strict=True) if code & side]
    return " and ".join(axes) or "no"


def _about_the_continuum(contact: Contact, area: float) -> list[Answer]:
    """Return three answers: area in the continuum, its error, and whether the grid resolves it.

    `area` is the area in the continuum [%]. The error [%] is "" if the grid does not resolve it.
    """
    error = contact.grid_error()
    error_percent = error.area_percent
    known_error: float | str
    if error.verdicts["area"]:
        unit = f"+- {error_percent:.2g} %, in 9 of 10 cases"
        known_error = error_percent
        resolved = "yes"
    else:
        unit = "% on this grid"
        known_error = ""
        resolved = "no"
    return [
        Answer(
            column=CONTINUUM.in_tables,
            value=area,
            label=CONTINUUM.noun,
            unit=unit,
            error=error_percent,
        ),
        Answer(
            column=CONTINUUM_ERROR,
            value=known_error,
            label="its error",
            unit="%",
            error=error_percent,
        ),
        Answer(
            column="resolved",
            value=resolved,
            label="resolved by the grid",
            unit=error.reason,
        ),
    ]


def _about_the_slip(
    contact: Contact, friction: Friction, shares: Sequence[float]
) -> list[Answer]:
    """Return five answers for each axis and each share of the force at which the bodies slide.

    They are the shift, the shear force, the tangent stiffness, the area that sticks and the loss.
    Only files have the last four, because the first one states them in its unit.
    """
    about_the_slip: list[Answer] = []
    for axis, axis_name in enumerate("xy"):
        for point in Sheared(contact, friction, axis).curve(shares):
            column = f"{axis_name}_at_{point.share:g}"
            shift = Answer(
                column=f"shift_{column}_um",
                value=point.shift,
                label=f"shift along {axis_name} at {point.share:g} of sliding",
                unit=f"um, {point.stick_percent:.4g} % of the patch sticks, a cycle loses"
                f" {point.loss:.4g} pJ",
            )
            about_the_slip += [
                shift,
                _detail(f"shear_force_{column}_uN", point.shear),
                _detail(f"tangent_stiffness_{column}_N_per_m", point.stiffness),
                _detail(f"stick_{column}_percent", point.stick_percent),
                _detail(f"loss_{column}_pJ", point.loss),
            ]
    return about_the_slip


def _about_the_grid(contact: Contact) -> list[Answer]:
    """Return two answers, the numbers of nodes along x and y of the grid that was solved."""
    rows, columns = contact.pressure.shape
    cells = accuracy.columns_of_grid((rows, columns))
    return [
        Answer(column=column, value=nodes, label=f"nodes along {axis}", unit="")
        for axis, (column, nodes) in zip("xy", cells.items(), strict=True)
    ]


def _about_the_errors(contact: Contact, errors: Mapping[str, float]) -> list[Answer]:
    """Return five answers for each error that was asked for, by the names of their answers [1].

    They are the error that was reached, the one that was asked for, and three parts of the first.
    `contact` is one from `bem.solve_within`.
    """
    assert contact.budget is not None  # `solve_within` sets it
    about_the_errors: list[Answer] = []
    for name, parts in accuracy.parts_of(contact.budget, errors).items():
        about_the_errors += _about_an_error(name, parts)
    return about_the_errors


def _about_an_error(name: str, parts: ErrorParts) -> list[Answer]:
    """Return five answers [%]: the error that was reached, the one asked for, and three parts.

    `name` is the name of the answer in `bem.answers.ANSWERS`. Only files have the last four,
    because the first one states them in its unit.
    """
    noun = accuracy.quantity_of(name).noun
    about_the_error: list[Answer] = []
    for column, value in accuracy.columns_of_error(name, parts).items():
        if accuracy.is_detail(column):
            about_the_error.append(_detail(column, value))
            continue
        answer = Answer(
            column=column,
            value=value,
            label=f"error of {noun}",
            unit=f"% of it at 95 %, {accuracy.parts_in_words(parts)}",
            error=value,  # the error's own size, so that it is shown with two digits
        )
        about_the_error.append(answer)
    return about_the_error


def _about_the_limits(limits: MapLimits) -> list[Answer]:
    """Return answers about the limits of a map; only files have those of the instrument."""
    about_the_limits: list[Answer] = []
    for column, value in limits.columns.items():
        if column != NODES_A_WAVE:
            about_the_limits.append(_detail(column, value))
            continue
        answer = Answer(
            column=column,
            value=value,
            label="limits of the map",
            unit=limits.remark,
            # The number's own size, so that it is shown with two digits.
            error=value if isinstance(value, float) else 0.0,
        )
        about_the_limits.append(answer)
    return about_the_limits


def _detail(column: str, value: float | int | str) -> Answer:
    """Return an answer that only files have."""
    return Answer(column=column, value=value, label=column, unit="", is_detail=True)


def _remark(quantity: Quantity, contact: Contact) -> str:
    """Return the remark for people that follows the unit of a quantity, "" for none."""
    nx, ny = contact.pressure.shape
    cell = math.prod(contact.problem.spacing)  # area of the cell of a node [um2]
    match quantity.name:
        case "contact_nodes":
            return f"of {nx} x {ny}"
        case "mean_spot_area":
            return f"a node has {cell:.4g}"
        case "contact_connects" | "gap_connects":
            return "directions"
        case "flow_factor_x" | "flow_factor_y" if not quantity.of(contact):
            return "no flow: the contact seals"
        case "interface_stiffness" | "interface_conductance":
            return _about_the_interface(contact)
    return quantity.remark


def _about_the_interface(contact: Contact) -> str:
    """Return a remark on the stiffness of the interface, "" for none.

    It says that the interface is closed, or that a constriction is left out.
    """
    if contact.interface_stiffness == math.inf:
        return "full contact, in which nothing but the bodies is left"
    if contact.problem.boundary == "free":
        return "without the patch's own constriction"
    return ""


def _conductance_per_area(contact: Contact, media: Media) -> Answer:
    """Return the answer about the interface's conductance per nominal area [W/(m2 K)]."""
    value = 1e12 * CONDUCTANCE.of(contact, media) / nominal_area(contact)  # um2 to m2
    unit = "W/(m2 K)"
    remark = _about_the_interface(contact)
    if remark:
        unit += f", {remark}"
    return Answer(
        column="interface_conductance_W_per_m2_K",
        value=value,
        label="per nominal area",
        unit=unit,
    )


CONTINUUM_ERROR = f"{CONTINUUM.name.removesuffix('_percent')}_error_percent"
"""Name of the column that holds the error of the area in the continuum."""
