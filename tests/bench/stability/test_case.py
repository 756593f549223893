"""How cases are run, refused and judged."""

import math

import numpy as np
import pytest

from bench.stability.case import Answer, Case, Finding, Refusal, run_case
from gen.runtime.errors import InputError


def test_what_was_to_be_refused_fails_without_an_error() -> None:
    refusal = Refusal(InputError, ("give less",))

    def refuse() -> None:
        raise InputError("too much: give less")

    assert run_case(Case("test", "test", "", refuse, refusal)).passed
    assert not run_case(Case("test", "test", "", dict, refusal)).passed
    assert not run_case(Case("test", "test", "", refuse, Refusal(ValueError, ()))).passed


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
    assert not Answer("").passed


def test_a_missing_extra_ends_the_table_and_is_no_failed_case():
    def learn() -> Answer:
        raise ModuleNotFoundError("No module named 'mapie'", name="mapie")

    with pytest.raises(ModuleNotFoundError, match="mapie"):
        run_case(Case("test", "test", "", learn))


def test_the_worst_check_is_the_one_that_failed() -> None:
    findings = (Finding("near", 0.9, 1.0), Finding("failed", 0.2, 0.1), Finding("far", 0.0, 1.0))
    assert Answer("", findings).worst.what == "failed"
    assert Answer("", findings[::2]).worst.what == "near"


def test_what_is_not_a_number_is_not_passed() -> None:
    assert not Finding("error", math.nan, 1.0).passed
