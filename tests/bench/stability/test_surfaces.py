"""Proof that the checks of surfaces can fail."""

import math
from dataclasses import replace

import numpy as np
import pytest

from bench.stability import surfaces
from bench.stability.case import Answer, run_case
from gen import statistics, surface
from gen.statistics import NAMES


def rough() -> np.ndarray:
    return surface.generate("diamond-square", 17, 0.65, 12.0, np.random.default_rng(0))


def verdict(answer: Answer) -> bool:
    return all(finding.passed for finding in answer.findings)


@pytest.mark.parametrize("name", NAMES)
def test_each_statistic_that_is_wrong_fails(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = statistics.describe(rough(), 2.0)
    assert verdict(surfaces.described(rough(), (2.0, 2.0)))
    value = found.values[name]
    for wrong in (value + 1e-10 * max(1.0, abs(value)), math.nan):
        other = replace(found, values=found.values | {name: wrong})
        monkeypatch.setattr(surfaces, "describe", lambda *_, other=other: other)
        assert not verdict(surfaces.described(rough(), (2.0, 2.0)))


def test_what_is_undefined_has_to_have_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    assert verdict(surfaces.says(np.zeros((5, 5)), "flat surface"))
    assert not verdict(surfaces.says(np.zeros((5, 5)), "two nodes"))
    assert not verdict(surfaces.says(rough()))
    silent = replace(statistics.describe(np.zeros((5, 5)), 1.0), reason="")
    monkeypatch.setattr(surfaces, "describe", lambda *_: silent)
    assert not verdict(surfaces.says(np.zeros((5, 5)), "flat surface"))


@pytest.mark.parametrize("generator", surface.GENERATORS)
def test_a_generator_that_is_wrong_fails(generator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    right = surface.GENERATORS[generator]

    def taller(nodes: int, hurst: float, sigma0: float, random: np.random.Generator) -> np.ndarray:
        heights = right(nodes, hurst, sigma0, random)
        heights[nodes // 2, 1] += 1e-9 * sigma0
        return heights

    (case,) = (case for case in surfaces.generator_cases() if case.name == f"H = 0.65, {generator}")
    monkeypatch.setattr(surface, "GENERATORS", {**surface.GENERATORS, generator: taller})
    assert not run_case(case).passed
