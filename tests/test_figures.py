"""Figures in the text of README.md and docs/ are those of `bench/results`.

Tables come from there when the manual is built (`tests/test_results.py`). A sentence with figures
stands here with the numbers that the files give, so that neither changes without the other.
"""

import csv
import re
from pathlib import Path
from statistics import mean

import pytest
from pages import PAGES, ROOT

RESULTS = ROOT / "bench" / "results"
OTHERS = {"bem", "paper's NNLS"}
"""Solvers in the comparison that are not another program."""


def rows(name: str) -> list[dict[str, str]]:
    with (RESULTS / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def stated(page: str, sentence: str) -> list[float]:
    """Return the numbers of a sentence, in which `#` stands for each of them.

    Blanks and ends of lines are the same.
    """
    words = r"\s+".join(re.escape(word) for word in sentence.split())
    (found,) = re.findall(words.replace(r"\#", r"(-?[\d,]*\d(?:\.\d+)?)"), PAGES[page])
    texts = (found,) if isinstance(found, str) else found
    return [float(text.replace(",", "")) for text in texts]


def test_the_paper_needed_as_long_as_is_said() -> None:
    (row,) = (row for row in rows("cost/cost.csv") if "as published" in row["features"])
    (seconds,) = stated("README.md", "implements needed # seconds (`bench/results/cost/cost.csv`)")
    assert seconds == pytest.approx(float(row["solve"]), abs=1)


def test_hertz_is_met_as_closely_as_is_said() -> None:
    force = {
        (row["solution"], row["nodes"]): float(row["force_uN"])
        for row in rows("hertz/hertz.csv")
        if float(row["delta_um"]) == 1.0
    }
    said, nodes, _ = stated(
        "README.md", "force within # % (# nodes a side, # um) | `bench/results/hertz/hertz.csv`"
    )
    error = abs(force["uniform-pressure", f"{nodes:.0f}"] / force["hertz", ""] - 1)
    assert said / 2 < 100 * error <= said


def test_all_extreme_cases_pass_that_are_counted() -> None:
    passed, cases = stated("README.md", "| stiff and extreme cases | # of # pass |")
    found = [
        row
        for path in (RESULTS / "stability").glob("*.csv")
        for row in rows(f"stability/{path.name}")
    ]
    assert cases == len(found)
    assert passed == sum(row["verdict"] == "passed" for row in found)


def test_the_fastest_other_solver_takes_as_long_as_is_said() -> None:
    low, high = stated("README.md", "the fastest takes # to # times our time")
    ratios: dict[tuple[str, ...], float] = {}
    for row in rows("peers/peers.csv"):
        if row["times_ours"] and row["solver"] not in OTHERS:
            case = row["nodes"], row["hurst"], row["delta_um"]
            ratios[case] = min(ratios.get(case, 1e9), float(row["times_ours"]))
    assert [low, high] == pytest.approx([min(ratios.values()), max(ratios.values())], rel=0.02)


@pytest.mark.parametrize(
    ("page", "sentence"),
    [("README.md", "of the same kind | area: nMAE # %, R2 # % |")],
)
def test_surrogates_are_as_good_as_is_said(page: str, sentence: str) -> None:
    found = [row for row in rows("features/features.csv") if row["features"] == "hybrid"]
    assert stated(page, sentence) == [
        round(mean(float(row[name]) for row in found), 2) for name in ("nmae", "r2")
    ]


def test_surrogates_hold_where_they_were_not_trained_as_is_said() -> None:
    page, found = "docs/results/surrogates.md", rows("generalisation/generalisation.csv")

    def of(name: str, case: str) -> list[float]:
        own = [row for row in found if row["tested_on"].startswith(case)]
        return [100 * float(row[name]) for row in own]

    said = stated(page, "of all rows, flagged or not, # and # % lie inside")
    assert said == [round(of("covered", case)[-1]) for case in ("unseen", "midpoint")]
    assert min(of("flagged", "fine grid")) == 100
    said = stated(page, "on # to # % of unseen Hurst exponents, and on # to # % of the other")
    flagged = [of("flagged", case) for case in ("unseen", "midpoint")]
    assert said == [round(end(each)) for each in flagged for end in (min, max)]
    (nmae,) = stated(page, "rows of this grid in the training the nMAE is # %")
    assert nmae == round(of("mended_nmae", "fine grid")[-1] / 100, 2)


def test_feature_sets_are_worth_what_is_said() -> None:
    quarters = [
        100 * float(row["covered"])
        for row in rows("features/coverage.csv")
        if "hybrid" in row["features"]
    ]
    ends = stated(
        "docs/how-to/surrogates.md", "In every quarter of the area, # to # % of the rows lie inside"
    )
    assert ends == [round(min(quarters)), round(max(quarters))]
    found = {
        row["features"]: row for row in rows("features/features.csv") if "hybrid" in row["features"]
    }
    solves = stated(
        "docs/how-to/surrogates.md",
        "of a new surface cost # solves with 33 blocks and # solves with 65",
    )
    assert solves == [round(float(row["solves"]), 2) for row in found.values()]
    small: dict[str, list[float]] = {}
    for row in rows("features/features.csv"):
        if "hybrid" not in row["features"]:
            continue
        small.setdefault(row["features"], []).append(float(row["small_p95"]))
    within = stated("docs/how-to/surrogates.md", "areas below 0.5 % are within # and # % of")
    assert within == [round(sum(each) / len(each)) for each in small.values()]


def test_bodies_that_yield_are_compared_as_is_said() -> None:
    low, high, least, most = stated(
        "docs/results/reports.md",
        "it takes # to # times the CPU time of ours and # to # times the convolutions;",
    )
    found = rows("peers/hardness.csv")
    ours = {
        (row["delta_um"], row["hardness"]): float(row["convolutions"])
        for row in found
        if row["solver"] == "bem"
    }
    theirs = [
        row for row in found if row["solver"] != "bem" and row["hardness"] and row["times_ours"]
    ]
    times = [float(row["times_ours"]) for row in theirs]
    convolutions = [
        float(row["convolutions"]) / ours[row["delta_um"], row["hardness"]] for row in theirs
    ]
    assert [low, high] == pytest.approx([min(times), max(times)], rel=0.03)
    assert [least, most] == pytest.approx([min(convolutions), max(convolutions)], rel=0.03)


def test_periodic_solvers_are_compared_as_is_said() -> None:
    low, high, least, most = stated(
        "docs/results/reports.md",
        "ASPHER's faster variant takes # to # times the CPU time of ours (least at 1 and at 99 %"
        " contact), the others # to # times",
    )
    aspher: dict[tuple[str, str], float] = {}
    others = []
    for row in rows("peers/periodic.csv"):
        if not row["times_ours"] or row["solver"] == "bem":
            continue
        ratio = float(row["times_ours"])
        if row["solver"].startswith("ASPHER"):
            case = row["nodes"], row["mean_pressure"]
            aspher[case] = min(aspher.get(case, 1e9), ratio)
        else:
            others.append(ratio)
    assert [low, high] == pytest.approx([min(aspher.values()), max(aspher.values())], rel=0.03)
    assert [least, most] == pytest.approx([min(others), max(others)], rel=0.03)


def test_a_surrogate_pays_from_where_it_is_said() -> None:
    numbers = stated(
        "docs/results/surrogates.md",
        "nMAE # % takes # hybrid training rows and pays from # contacts on, # %\n"
        "takes # and pays from #.",
    )
    learning = {
        float(row["trained"]): row
        for row in rows("cost/learning.csv")
        if row["features"] == "hybrid"
    }
    for nmae, trained, contacts in (numbers[:3], numbers[3:]):
        row = learning[trained]
        assert float(row["nmae"]) <= nmae
        assert float(row["break_even"]) == contacts


def test_the_costs_of_the_grid_are_those_measured() -> None:
    """Memory of the dearest candidates, and how a tolerance trades."""
    (largest, xgboost, ridge, forest, boosting) = stated(
        "docs/results/models.md",
        "at most # GiB (Gaussian process), # (XGBoost), # (kernel ridge), # (forest), # (gradient"
        " boosting)",
    )
    peak: dict[str, float] = {}
    for row in rows("memory/memory.csv"):
        peak[row["model"]] = max(peak.get(row["model"], 0), float(row["peak"]))
    names = "gaussian-process", "xgboost", "kernel-ridge", "random-forest", "gradient-boost"
    said = [largest, xgboost, ridge, forest, boosting]
    assert said == pytest.approx([peak[name] for name in names], abs=0.06)


def test_files_that_the_text_names_are_there() -> None:
    for page, text in PAGES.items():
        for name in re.findall(
            r"`((?:bench/results|tests|examples|figures|gen|learn|bem)/[\w./-]+)`", text
        ):
            assert (ROOT / Path(name)).exists(), f"{page}: {name}"
