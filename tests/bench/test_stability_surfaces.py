"""The table of surfaces, and proof that its checks can fail."""

import math
from dataclasses import replace

import numpy as np
import pytest
from stability import assert_in_order, assert_passes, title

from bench.stability.case import Answer, Case, Result, refused, run_case
from bench.stability.finding import Finding, Refusal
from bench.stability.surfaces import checks, exact
from bench.stability.surfaces.sheet import SHEET
from gen import statistics, surface
from gen.runtime.errors import InputError
from gen.statistics import NAMES

LARGE = {"k = 9", "k = 10", "k = 11"}
FAST = [case for case in SHEET.cases if not {case.name, case.name.partition(",")[0]} & LARGE]


@pytest.mark.parametrize("case", FAST, ids=title)
def test_case(case: Case) -> None:
    assert_passes(case)


def test_names_are_unique_and_families_stand_together() -> None:
    assert_in_order(SHEET)


def test_what_was_promised_is_in_the_table() -> None:
    names = {case.name for case in SHEET.cases}
    assert {f"k = {k}" for k in range(1, 12)} <= names
    for generator in surface.GENERATORS:
        wanted = {f"H = {hurst}, {generator}" for hurst in ("0", "1", "1 less one ulp", "5e-324")}
        wanted |= {f"\u03c30 = {size}, {generator}" for size in ("0", "1e-12 um", "1e12 um")}
        assert wanted | {f"k = {k}, {generator}" for k in range(1, 12)} <= names
    assert {"1e+08 um", "one peak", "no peak", "plateaus", "exact ties"} <= names
    assert {"float32", "int64", "Fortran order", "read-only", "NaN", "infinity"} <= names


def rough() -> np.ndarray:
    return surface.generate("diamond-square", 17, 0.65, 12.0, np.random.default_rng(0))


def verdict(answer: Answer) -> bool:
    return all(finding.passed for finding in answer.findings)


@pytest.mark.parametrize("name", NAMES)
def test_each_statistic_that_is_wrong_fails(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = statistics.describe(rough(), 2.0)
    assert verdict(checks.described(rough(), (2.0, 2.0)))
    value = found.values[name]
    for wrong in (value + 1e-10 * max(1.0, abs(value)), math.nan):
        other = replace(found, values=found.values | {name: wrong})
        monkeypatch.setattr(checks, "describe", lambda *_, other=other: other)
        assert not verdict(checks.described(rough(), (2.0, 2.0)))


def test_what_is_undefined_has_to_have_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    assert verdict(checks.says(np.zeros((5, 5)), "flat surface"))
    assert not verdict(checks.says(np.zeros((5, 5)), "two nodes"))
    assert not verdict(checks.says(rough()))
    silent = replace(statistics.describe(np.zeros((5, 5)), 1.0), reason="")
    monkeypatch.setattr(checks, "describe", lambda *_: silent)
    assert not verdict(checks.says(np.zeros((5, 5)), "flat surface"))


def test_an_image_that_is_none_fails() -> None:
    assert verdict(checks.unchanged(rough(), change=np.array))
    assert not verdict(checks.unchanged(rough(), change=lambda z: z * (1 + 1e-15)))
    assert not verdict(checks.unchanged(rough(), change=np.transpose))


@pytest.mark.parametrize("generator", surface.GENERATORS)
def test_a_generator_that_is_wrong_fails(generator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    right = surface.GENERATORS[generator]

    def taller(nodes: int, hurst: float, sigma0: float, random: np.random.Generator) -> np.ndarray:
        heights = right(nodes, hurst, sigma0, random)
        heights[nodes // 2, 1] += 1e-9 * sigma0
        return heights

    (case,) = (case for case in FAST if case.name == f"H = 0.65, {generator}")
    monkeypatch.setattr(surface, "GENERATORS", {**surface.GENERATORS, generator: taller})
    assert not run_case(case).passed


def test_fractions_know_closed_forms() -> None:
    pyramid = np.array([[0.0, 0, 0, 0], [0, 3, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]])
    found = exact.statistics(pyramid, (1.0, 2.0))
    assert found["height_mean"] == 0.25
    assert found["asperity_curvature_mean"] == (6 + 6 / 4) / 2
    assert found["peak_density"] == 2 / 32
    assert math.isnan(found["asperity_skewness"])
    assert exact.root(exact.Fraction(2)) ** 2 == pytest.approx(2, rel=1e-15)


def test_what_was_to_be_refused_fails_without_an_error() -> None:
    refusal = Refusal(InputError, ("give less",))

    def refuse() -> None:
        raise InputError("too much: give less")

    assert run_case(refused("test", "test", "", refuse, refusal)).passed
    assert not run_case(refused("test", "test", "", dict, refusal)).passed
    assert not run_case(refused("test", "test", "", refuse, Refusal(ValueError, ()))).passed


def test_warnings_and_errors_fail() -> None:
    def warn() -> Answer:
        np.float64(1.0) / np.float64(0.0)
        return Answer("", [Finding("nothing", 0, 0)])

    result = run_case(Case("test", "test", "", warn))
    assert not result.passed
    assert "warning divide by zero" in result.worst.what
    broken = run_case(Case("test", "test", "", lambda: 1 / 0))
    assert broken.out == "division by zero"
    assert not broken.passed
    assert not Result(Case("test", "test", "", warn), "").passed


def test_a_missing_extra_ends_the_table_and_is_no_failed_case():
    def learn() -> Answer:
        raise ModuleNotFoundError("No module named 'mapie'", name="mapie")

    with pytest.raises(ModuleNotFoundError, match="mapie"):
        run_case(Case("test", "test", "", learn))


def test_the_worst_check_is_the_one_that_failed() -> None:
    findings = (Finding("near", 0.9, 1.0), Finding("failed", 0.2, 0.1), Finding("far", 0.0, 1.0))
    case = Case("test", "test", "", lambda: Answer("", ()))
    assert Result(case, "", findings).worst.what == "failed"
    assert Result(case, "", findings[::2]).worst.what == "near"
