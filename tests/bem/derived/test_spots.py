"""Spots of contact, their areas, and whether contact and gap cross the patch."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

import bem
from bem.derived.spots import spots_of

DRAWN = {"#": True, ".": False}


def drawn(*rows):
    return np.array([[DRAWN[node] for node in row] for row in rows])


def test_spots_join_along_sides_and_come_largest_first():
    spots = spots_of(drawn("#..##", ".#.##", "....."), 2.0, periodic=False)
    assert spots.number == 3
    assert spots.areas.tolist() == [8.0, 2.0, 2.0]
    assert spots.labels.tolist() == [[2, 0, 0, 1, 1], [0, 3, 0, 1, 1], [0, 0, 0, 0, 0]]
    assert spots.largest_share == pytest.approx(2 / 3)
    assert spots.contact_connects == (False, False)
    assert spots.gap_connects == (True, True)
    assert spots.open_gap.tolist() == (spots.labels == 0).tolist()


def test_pockets_that_cross_nothing_are_not_open():
    spots = spots_of(drawn("..#..", "#####", "..#.."), 1.0, periodic=False)
    assert not spots.open_gap.any()
    spots = spots_of(drawn("..#..", "..#..", "..###"), 1.0, periodic=False)
    assert spots.open_gap.tolist() == drawn("##...", "##...", "##...").tolist()


def test_a_gap_is_open_across_the_seam_of_a_patch_that_repeats():
    spots = spots_of(drawn("#...#", ".#..#", "#...#"), 1.0, periodic=True)
    assert spots.open_gap[:, 2].all()


def test_spots_of_a_patch_that_repeats_join_across_its_borders():
    touching = drawn("#...#", ".....", ".....", "#...#")
    assert spots_of(touching, 1.0, periodic=False).number == 4
    spots = spots_of(touching, 1.0, periodic=True)
    assert spots.areas.tolist() == [4.0]
    assert spots.contact_connects == (False, False)


def test_touching_both_sides_is_not_yet_crossing_a_patch_that_repeats():
    shifted = drawn("##...", ".....", "...##")
    assert spots_of(shifted, 1.0, periodic=True).contact_connects == (False, False)
    spiral = drawn("##...", ".####", "....#", "#...#")
    assert spots_of(spiral, 1.0, periodic=True).contact_connects == (True, True)
    ring = drawn(".....", "#####", ".....")
    spots = spots_of(ring, 1.0, periodic=True)
    assert (spots.contact_connects, spots.gap_connects) == ((False, True), (False, True))


@given(arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=9)), st.data())
@settings(max_examples=150, deadline=None)
def test_a_patch_that_repeats_has_the_same_spots_wherever_it_begins(touching, data):
    shift = tuple(data.draw(st.integers(0, nodes - 1)) for nodes in touching.shape)
    here = spots_of(touching, 1.0, periodic=True)
    there = spots_of(np.roll(touching, shift, axis=(0, 1)), 1.0, periodic=True)
    assert here.areas.tolist() == there.areas.tolist()
    assert here.contact_connects == there.contact_connects
    assert here.gap_connects == there.gap_connects
    assert here.areas.sum() == touching.sum()
    turned = spots_of(touching.T, 1.0, periodic=True)
    assert turned.contact_connects == here.contact_connects[::-1]


@given(arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=7)))
@settings(max_examples=100, deadline=None)
def test_crossing_without_end_is_crossing_many_patches(touching):
    """In so many copies that no path could need more, something crosses them or it does not."""
    many = max(touching.shape) + 1
    tiled = np.tile(touching, (many, many))
    crosses = spots_of(tiled, 1.0, periodic=False).contact_connects
    assert spots_of(touching, 1.0, periodic=True).contact_connects == crosses


def test_contacts_know_their_spots():
    x = np.linspace(-1, 1, 65) * 50
    contact = bem.solve(-(x[:, np.newaxis] ** 2 + x**2) / 1000, 100.0, 1.5)
    assert contact.spots.number == 1
    area = contact.area_percent / 100 * 65**2 * (100 / 64) ** 2
    assert contact.spots.areas[0] == pytest.approx(area)
