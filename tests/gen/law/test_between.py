"""Contacts between the loads of a law."""

import numpy as np

from gen.law import between
from gen.law.curves import Curve, Curves

NODES = 10**4


def law_at(pressures):
    """A law whose conductance jumps by 9 % eight times a decade, at ascending pressures."""
    jumps = np.floor(8 * np.log10(pressures))
    columns = {
        "closure_um": np.log1p(pressures),
        "area_percent": pressures,
        "conductance_W_per_mm2_K": pressures**0.6 * 1.09**jumps,
    }
    unknown = np.full(pressures.size, np.nan)
    return Curves(
        "pressure_MPa",
        pressures,
        {name: Curve(each, unknown, unknown, unknown) for name, each in columns.items()},
        np.zeros(pressures.size),
        ("",) * pressures.size,
        {},
        np.zeros(pressures.size, dtype=bool),
    )


def test_lines_are_improved_until_no_contact_between_others_can_be_further_off(
    monkeypatch,
):
    monkeypatch.setattr(between, "IMPROVEMENTS", 20)
    table = law_at(np.geomspace(3, 80, 5))
    contacts = between.solve_for_lines(table, NODES, law_at)
    known = between.merged(table, contacts)
    doubtful = between._doubtful(known, np.isin(known.at, table.at), NODES)
    assert doubtful.size == 0
    assert contacts.at.size < between.MOST_CONTACTS


def test_no_more_contacts_are_solved_than_are_allowed(monkeypatch):
    monkeypatch.setattr(between, "MOST_CONTACTS", 60)
    contacts = between.solve_for_lines(law_at(np.geomspace(0.5, 80, 7)), NODES, law_at)
    assert contacts.at.size == 60
