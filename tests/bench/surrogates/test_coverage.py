"""The study of coverage: what trains, what judges, and what is counted."""

import numpy as np
import pytest

from bench.surrogates import coverage as study
from bench.surrogates import kinds
from bench.surrogates.coverage import HARDNESS, by_kind, cases, column, coverage, verdict
from gen.runtime.errors import InputError

pytestmark = pytest.mark.long

SMALL = {
    "paper": "[surface]\nnodes = 17\n",
    "midpoint": 'seed = 2026\n[surface]\nnodes = 17\ngenerator = "midpoint"\n',
    "fine-257": "seed = 2026\n[surface]\nnodes = 33\n",
    "paper-yielding": "[surface]\nnodes = 17\n[contact]\nhardness_ratio = [0.003, 0.1]\n",
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with the study of few small surfaces without the broad scenes, and its rows."""
    folder = tmp_path_factory.mktemp("coverage")

    def databases(place, rows):
        return {
            name: study.generated(place, name, f"samples = 300\n{text}{study.STORE}")
            for name, text in SMALL.items()
        }

    few = (("paper",), ("paper", "midpoint"), ("paper", "fine-257"), ("paper-yielding",))
    with pytest.MonkeyPatch.context() as small:
        small.setattr(study, "databases", databases)
        small.setattr(study, "pools", lambda: few)
        small.setattr(study, "FINE", {257: "fine-257"})
        return folder, coverage(folder, 300, 2)


def test_every_case_is_judged_with_every_seed(made):
    found = made[1].tables["coverage-seeds"]
    names = [(row["trained_on"], row["tested_on"], row["seed"]) for row in found]
    assert len(set(names)) == 2 * 7
    assert len(names) == 3 * 2 * 7
    for row in found:
        assert 0 <= row["flagged"] <= 1
        assert row["unflagged"] == round(row["judged"] * (1 - row["flagged"]))
    found = [row for row in found if row["target"] == "area"]
    by_case = {row["trained_on"]: row for row in found if row["tested_on"] == "fine-257"}
    assert by_case["preset"]["flagged"] == 1  # another grid, and the nodes are a feature
    assert by_case["preset and 20 rows of fine-257"]["flagged"] < 1
    (hardness, *_) = (row for row in found if row["tested_on"] == "other hardness")
    assert hardness["flagged"] == 1


def test_rows_that_judge_train_nothing(made):
    folder, _ = made
    paths = {name: folder / "databases" / f"{name}.h5" for name in SMALL}
    for pool in (("paper",), ("paper", "midpoint"), ("paper-yielding",)):
        rows = study._read(*(paths[name] for name in pool))[0]
        for case in cases(pool, rows, 0):
            parts = study._parts(case, rows, 200, 0)
            judged = parts.test if case.judged is None else rows.at(case.judged)
            train, test = (
                set(zip(e.database, e.rows, strict=True)) for e in (parts.train, judged)
            )
            assert not train & test
            assert parts.train.size == parts.folds.size
            if case.tested_on == "Hurst exponents above":
                assert (
                    column(parts.train, "hurst").max()
                    <= 0.7
                    < column(judged, "hurst").min()
                )
            if case.tested_on == "other hardness":
                inside = column(parts.train, "hardness")
                assert HARDNESS[0] <= inside.min() <= inside.max() <= HARDNESS[1]


def test_verdicts_allow_for_a_standard_error():
    assert verdict(np.nan, np.nan, 0) == "all flagged"
    assert verdict(0.5, 0.1, 29) == "few unflagged"
    assert verdict(0.86, 0.0, 30) == "met"
    assert verdict(0.85, 0.02, 30) == "met within its error"
    assert verdict(0.83, 0.02, 30) == "not met"


@pytest.mark.parametrize("name", kinds.NAMES)
def test_every_kind_makes_surfaces_of_its_own(name):
    make, shape, spacing = getattr(kinds, name), (33, 33), (30.0, 30.0)
    first, again, other = (
        make(shape, spacing, np.random.default_rng(n)) for n in (0, 0, 1)
    )
    np.testing.assert_array_equal(first, again)
    assert first.shape == shape
    assert np.isfinite(first).all()
    assert first.std() > 0
    assert not np.allclose(first, other)


def test_kinds_have_a_row_with_all_targets():
    row = {
        "trained_on": "preset",
        "judged": 5,
        "flagged": 0.2,
        "unflagged": 4,
        "empty": 1,
    }
    row |= {"covered_unflagged": 0.9, "width": 7.0}
    names = [
        ("kinds", "area"),
        ("kinds: worn", "area"),
        ("kinds: worn", "force"),
        ("fine", "area"),
    ]
    table = [row | {"tested_on": tested, "target": target} for tested, target in names]
    every, worn = by_kind(table)
    assert (every["kind"], worn["kind"], worn["empty"]) == ("all", "worn", 2)
    assert worn["force"] == 0.9
    assert worn["area_width"] == 7.0


def test_too_few_rows_are_refused(tmp_path):
    with pytest.raises(
        InputError, match=r"--rows 10, --seeds 3: give 300 rows and 1 seed or more"
    ):
        coverage(tmp_path, 10, 3)
