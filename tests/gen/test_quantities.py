"""The table of quantities: its powers are those of solved contacts, and it is the only table."""

import ast
import math
from pathlib import Path

import numpy as np
import pytest

import bem
from gen.generation.sample import compute_rows
from gen.law.order import require_also
from gen.material import Friction, Gas
from gen.quantities import (
    ALSO,
    IN_LAWS,
    LAW_COLUMNS,
    LIKE_HEIGHTS,
    LIKE_PRESSURES,
    LOADS,
    OF_SHEAR,
    QUANTITIES,
    Media,
    Powers,
    stored_quantities,
    typographic,
)
from gen.runtime.errors import InputError
from gen.scene import Scene, columns_for
from gen.schema import Status

ROOT = Path(__file__).resolve().parents[2]
MEDIA = Media(
    conductivities=(50.0, 20.0), gas=Gas(0.026, 0.4), friction=Friction(0.3, 0.3)
)
NODES = (24, 21)
SIDE = (120.0, 100.0)
DELTA = 0.9
SCALES = [Powers(1, 0, 0), Powers(0, 1, 0), Powers(0, 0, 1)]


def heights() -> np.ndarray:
    z = np.random.default_rng(3).normal(size=NODES)
    return z - z.mean()


def factor(powers: Powers, doubled: Powers) -> float:
    return 2.0 ** sum(
        power * double for power, double in zip(powers, doubled, strict=True)
    )


def solved(boundary: str, hardness: float | None, doubled: Powers) -> bem.Contact:
    """A contact with heights, lengths or E* at twice their size, and the hardness as a pressure."""
    sides = tuple(side * 2.0**doubled.lengths for side in SIDE)
    return bem.solve(
        heights() * 2.0**doubled.heights,
        sides,
        DELTA * factor(LIKE_HEIGHTS, doubled),
        modulus=3.0 * 2.0**doubled.modulus,
        boundary=boundary,
        hardness=hardness and hardness * factor(LIKE_PRESSURES, doubled),
    )


@pytest.mark.parametrize("hardness", [None, 0.05])
@pytest.mark.parametrize("boundary", ["free", "periodic", "mirror"])
def test_powers_are_those_of_solved_contacts(boundary, hardness):
    first = solved(boundary, hardness, Powers(0, 0, 0))
    for doubled in SCALES:
        other = solved(boundary, hardness, doubled)
        for quantity in QUANTITIES.values():
            if quantity.powers is None:
                continue
            if hardness and quantity in OF_SHEAR:  # elastic bodies alone
                continue
            changed = quantity.of(other, MEDIA)
            value = np.asarray(quantity.of(first, MEDIA))
            expected = value * factor(quantity.powers, doubled)
            np.testing.assert_allclose(
                changed, expected, rtol=1e-9, err_msg=quantity.name
            )


def test_what_has_no_powers_scales_with_none():
    first = solved("mirror", None, Powers(0, 0, 0))
    for quantity in QUANTITIES.values():
        if quantity.powers is None:
            other = solved("mirror", None, Powers(1, 0, 0))
            power = math.log2(quantity.of(other, MEDIA) / quantity.of(first, MEDIA))
            assert abs(power - round(power)) > 1e-6, quantity.name


@pytest.mark.parametrize("boundary", ["free", "mirror"])
def test_values_at_first_touch_are_those_of_a_light_contact(boundary):
    light = bem.solve(heights(), SIDE, 1e-7, modulus=3.0, boundary=boundary)
    insulating = Media(
        conductivities=(1e-9, 1e-9), gas=MEDIA.gas
    )  # the one node that touches
    for quantity in QUANTITIES.values():
        if quantity.at_rest is not None:
            resting = quantity.resting(light.problem, insulating)
            assert quantity.of(light, insulating) == pytest.approx(resting, rel=0.02), (
                quantity.name
            )


@pytest.mark.parametrize("boundary", ["free", "mirror"])
def test_values_at_full_contact_are_those_of_a_heavy_contact(boundary):
    heavy = bem.solve(
        1e-3 * heights(), SIDE, pressure=1.0, modulus=3.0, boundary=boundary
    )
    assert heavy.area_percent == 100
    for quantity in QUANTITIES.values():
        if quantity.at_full is not None and not quantity.needs_hardness:
            full = quantity.at_full(heavy.problem)
            value = quantity.of(heavy, MEDIA)
            tolerance = {"rel": 1e-6, "abs": 1e-6}
            if "conductance" in quantity.name and math.isfinite(full):
                full *= 1e-6 * (2 * 50 * 20 / 70) / 3.0
            assert value == pytest.approx(full, **tolerance), quantity.name


def test_bounds_and_trends_are_those_of_a_ladder_of_loads():
    contacts = list(
        bem.ladder(heights(), SIDE, deltas=np.geomspace(0.05, 2, 8), modulus=3.0)
    )
    for quantity in IN_LAWS.values():
        values = [quantity.in_law(contact, MEDIA) for contact in contacts]
        low, high = quantity.bounds
        assert low <= min(values), quantity.name
        assert max(values) <= high, quantity.name
        if quantity.law.trend == "rises":
            assert values == sorted(values), quantity.name
        if quantity.law.trend == "falls":
            assert values == sorted(values, reverse=True), quantity.name


def test_every_column_that_can_be_stored_is_filled():
    names = [
        quantity.name for quantity in stored_quantities() if quantity.stored == "asked"
    ]
    keys = "\n".join(f"{name} = true" for name in names)
    text = f"samples = 3\n[surface]\nnodes = 17\n[contact]\nhardness = 0.02\n[store]\n{keys}\n"
    scene = Scene.parse(text, "test")
    rows = compute_rows(scene, 0, 3)
    assert (rows["status"] == Status.DONE).all()
    for column in columns_for(scene):
        if column.dtype.startswith("f"):
            assert np.isfinite(rows[column.name]).all(), column.name
    assert {*names} <= rows.keys()


def test_no_two_quantities_share_a_short_name():
    names = [quantity.law.short for quantity in IN_LAWS.values()]
    assert len(set(names)) == len(names)


def test_no_two_quantities_share_a_column_of_tables():
    columns = [
        quantity.in_tables for quantity in QUANTITIES.values() if not quantity.per_node
    ]
    assert len(set(columns)) == len(columns)


def test_a_law_over_delta_can_have_every_quantity_of_laws():
    assert {*LAW_COLUMNS["delta_um"]} | {"delta_um"} == IN_LAWS.keys()


def test_units_are_printed_with_their_signs():
    texts = [
        typographic(unit) for unit in ("um", "um2", "uN", "MPa/um", "W/(mm2 K)", "um-1")
    ]
    assert texts == ["µm", "µm²", "µN", "MPa/µm", "W/(mm² K)", "µm-1"]


def test_unknown_quantities_of_a_law_are_one_line():
    with pytest.raises(
        InputError, match=r"--also 'area': give one of contact_nodes, .*perimeter"
    ):
        require_also(["perimeter", "area"])
    assert require_also(["perimeter, largest_pressure", "perimeter"]) == (
        "perimeter",
        "largest_pressure",
    )


NAMES = {
    *QUANTITIES,
    *(quantity.in_tables for quantity in QUANTITIES.values()),
    *IN_LAWS,
}
ELSEWHERE = {"learn/dataset.py: TARGETS"}
"""Displays of quantities' names outside the table: the two targets of the paper."""


def displays(path: Path):
    """Every list, tuple, set and dictionary of a file: its name, if it has one, and its texts."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    named = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.AnnAssign | ast.Assign) and node.value is not None:
            target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
            named[id(node.value)] = ast.unparse(target)
    for node in ast.walk(tree):
        if isinstance(node, ast.List | ast.Tuple | ast.Set):
            texts = node.elts
        elif isinstance(node, ast.Dict):
            texts = [*filter(None, node.keys), *node.values]
        else:
            continue
        values = [text.value for text in texts if isinstance(text, ast.Constant)]
        yield named.get(id(node), f"line {node.lineno}"), {*map(str, values)}


def test_no_other_table_lists_quantities():
    """Names of loads alone are not a list of results: a scene or a command takes these."""
    lists = set()
    packages = (ROOT / package for package in ("gen", "learn", "bench", "asperity"))
    for path in sorted(path for package in packages for path in package.rglob("*.py")):
        where = path.relative_to(ROOT).as_posix()
        for name, texts in displays(path):
            quantities = texts & NAMES
            if len(quantities) > 1 and quantities - LOADS.keys():
                lists.add(f"{where}: {name}")
    outside = {place for place in lists if not place.startswith("gen/quantities.py")}
    assert outside == ELSEWHERE


def test_quantities_that_a_law_has_by_name_are_neither_codes_nor_fields():
    assert ALSO
    for quantity in ALSO.values():
        assert not quantity.code, quantity.name
        assert not quantity.per_node, quantity.name
