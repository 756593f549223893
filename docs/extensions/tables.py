"""The tables of the manual, made of the files in `bench/results` and of the code's own lists."""

import csv
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from bench.answers import FIRST, FURTHER
from bench.answers import lines as answers
from bench.record import Inputs
from bench.report import PARTS
from gen.maps.settings import PREPARED, as_option, keys
from gen.scene import markdown_of_columns
from learn.comparison.folder import KINDS
from learn.comparison.grid import LIBRARY
from learn.models import MODELS

RESULTS = Path(__file__).resolve().parents[2] / "bench" / "results"
FEATURES = "paper", "dimensionless", "hybrid"
Row = dict[str, str]


def table(name: str) -> list[Row]:
    """Read the rows of a file in `bench/results`."""
    with (RESULTS / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def scores(comparison: str) -> dict[tuple[str, str], Row]:
    """Read the scores of a comparison by model and result."""
    rows = table(f"{comparison}/area/scores.csv")
    return {(row["model"], row["result"]): row for row in rows}


def cells(row: Row, *names: str) -> str:
    """Return values of a row with two decimals, as cells of Markdown; none as a dash."""
    return " | ".join(f"{float(row[name]):.2f}" if row[name] else "-" for name in names)


def pair(row: Row, first: str, second: str) -> str:
    """Return two values of a row in one cell."""
    return f"{float(row[first]):.2f}, {float(row[second]):.2f}"


SCORES = ("nmse", "nmae", "nmaxe", "r2")
"""Columns of the four scores."""

WORDS = {"tuned": ", tuned", "baseline": "", "library": ", its library's own"}
"""What is added to the name of a model, by the kind of its result."""


def models() -> list[str]:
    """Scores of the nine models beside the paper's Table 4."""
    rows = scores("comparison")
    lines = []
    for model, result in product(MODELS, KINDS):
        row = rows.get((model, result))
        if row is None:
            continue
        words = WORDS[result]
        if result == "baseline" and model in LIBRARY:
            words = ", the paper's kernel"
        lines.append(f"| {MODELS[model].title}{words} | {beside_the_papers(row)} |")
    return lines


def beside_the_papers(row: Row) -> str:
    """Return the scores of a row and the paper's, as cells of Markdown."""
    theirs = cells(row, *(f"paper_{name}" for name in SCORES))
    return f"{cells(row, *SCORES)} | {theirs}"


def searched() -> list[str]:
    """Scores of the winners of the search of all nine grids, with the candidates that it judged.

    Tables of before version 1.1.0 do not say which settings of a winner are at an end.
    """
    rows_of_scores = scores("search")
    lines = []
    for row in table("search/area/tuning.csv"):
        model = row["model"]
        title = MODELS[model].title
        judged = (
            f"{int(row['candidates_scored']):,} of {int(row['candidates_differing']):,}"
        )
        winner = rows_of_scores[model, "tuned"]
        r2 = cells(winner, "r2", "paper_r2")
        nmae = cells(winner, "nmae", "paper_nmae")
        ends = row.get("ends") or "-"
        lines.append(
            f"| {title} | {row['rows']} | {judged} | {row['winner']} | {ends} | {nmae} | {r2} |"
        )
    return lines


def hybrid() -> list[str]:
    """Baselines with the paper's features and with hybrid ones."""
    of_paper = scores("comparison")
    of_hybrid = scores("comparison-hybrid")
    return [
        f"| {MODELS[model].title} | {pair(of_paper[model, 'baseline'], 'nmse', 'r2')}"
        f" | {pair(of_hybrid[model, 'baseline'], 'nmse', 'r2')} |"
        for model in MODELS
    ]


def surrogates() -> list[str]:
    """R2 and nMAE of each feature set where it was not trained."""
    cells_by_case: dict[str, list[str]] = {}
    for row in table("generalisation/generalisation.csv"):
        if "same heights" not in row["tested_on"]:
            of_case = cells_by_case.setdefault(row["tested_on"], [])
            of_case.append(pair(row, "r2", "nmae"))
    return [
        f"| {' | '.join([case, *columns])} |" for case, columns in cells_by_case.items()
    ]


SOLVERS = {
    "ContactMechanics, dual conjugate gradients, on the free half-space": (
        "ContactMechanics dual",
    ),
    "the same, with a margin that makes its FFT fast": ("ContactMechanics dual, margin",),
    "Tamaas, with such a margin": ("Tamaas, margin",),
    "ASPHER, as it comes (it is given the load)": ("ASPHER",),
    "ASPHER, on nested grids, with a margin, the faster of its two operators": (
        "ASPHER nested, stencil, margin",
        "ASPHER nested, FFT, margin",
    ),
    "the paper's algorithm, up to 1,200 nodes in contact": ("paper's NNLS",),
}


def peers() -> list[str]:
    """Smallest and largest ratio over the displacements, of the faster of several variants."""
    ratios_by_solver: dict[tuple[str, str], dict[str, float]] = {}
    for row in table("peers/peers.csv"):
        if row["times_ours"] and row["hurst"] == "0.65":
            ratios = ratios_by_solver.setdefault((row["solver"], row["nodes"]), {})
            ratios[row["delta_um"]] = float(row["times_ours"])

    def ends(names: tuple[str, ...], nodes: str) -> str:
        of_variants = [ratios_by_solver[name, nodes] for name in names]
        fastest = [
            min(ratios[delta] for ratios in of_variants if delta in ratios)
            for delta in of_variants[0]
        ]
        low, high = (
            f"{ratio:.{2 if ratio < 100 else 3}g}"
            for ratio in (min(fastest), max(fastest))
        )
        return low if len(fastest) == 1 else f"{low} to {high}"

    sizes = sorted({nodes for _, nodes in ratios_by_solver}, key=int)
    return [
        f"| {title} | {' | '.join(ends(names, nodes) for nodes in sizes)} |"
        for title, names in SOLVERS.items()
    ]


def cost() -> list[str]:
    """From how many contacts on a surrogate pays, and how much cheaper its answers are."""
    rows = [row for row in table("cost/cost.csv") if row["solver"] == "ours"]
    row_by_question = {(row["asked"], row["features"]): row for row in rows}
    times = {row["model"]: row for row in table("comparison/area/tuning-times.csv")}
    search = float(times["kernel-ridge"]["fit_seconds"])

    def line(title: str, question: str, text: Callable[[Row], str]) -> str:
        columns = [text(row_by_question[question, features]) for features in FEATURES]
        return f"| {title} | {' | '.join(columns)} |"

    def contacts_for_search(row: Row) -> str:
        saved = float(row["solve"]) - float(row["query"])
        return f"{search / saved:,.0f}" if row["features"] == "paper" else "not searched"

    def contacts_with_search(row: Row) -> str:
        saved = float(row["solve"]) - float(row["query"])
        contacts = float(row["break_even"]) + search / saved
        return f"{contacts:,.0f}" if row["features"] == "paper" else "not searched"

    def cheaper(row: Row) -> str:
        return f"{float(row['solve']) / float(row['query']):.3g}"

    return [
        line(
            "with the settings that come with the program, pays from so many contacts on",
            "new surfaces",
            lambda row: f"{int(row['break_even']):,}",
        ),
        line("with a search for settings", "new surfaces", contacts_with_search),
        line(
            "contacts that pay for the search alone",
            "new surfaces",
            contacts_for_search,
        ),
        line(
            "an answer, with its statistics, is cheaper than a solve, times",
            "new surfaces",
            cheaper,
        ),
        line(
            "a further load on a known surface, than the next of a ladder, times",
            "loads on one surface",
            cheaper,
        ),
    ]


def scans() -> list[str]:
    """Surrogates of measured maps on tiles and maps that they have not seen."""
    lines = []
    for row in table("scans/scans.csv"):
        if row["map"] == "all":
            names = ("covered", "flagged", "covered_unflagged")
            shares = [f"{100 * float(row[name]):.1f}" for name in names]
            flagged = round(float(row["wrong"]) * float(row["wrong_flagged"] or 0))
            wrong = f"{float(row['width']):.2f} | {row['wrong']}, {flagged}"
            wrong += f" | {1000 * float(row['wrong_unflagged']):.1f}"
            size = f"{row['nodes']} x {row['nodes']} nodes, {row['left_out']}"
            lines.append(
                f"| {size} | {pair(row, 'r2', 'nmae')} | {' | '.join(shares)} | {wrong} |"
            )
    return lines


def growths() -> list[str]:
    """Growths to an error: rows and looks, what is promised, and the truth on fresh rows."""
    rows_by_growth: dict[tuple[str, str], dict[str, Row]] = {}
    for row in table("grow/grow.csv"):
        of_growth = rows_by_growth.setdefault((row["population"], row["seed"]), {})
        of_growth[row["target"]] = row
    lines = []
    for (population, seed), targets in rows_by_growth.items():
        first = targets["area"]
        columns = [
            f"{population}, seed {seed}",
            f"{float(first['asked']):g}",
            first["rows"],
        ]
        for row in targets.values():
            columns.append(pair(row, "nmae", "at_most"))
            columns.append(
                f"{float(row['fresh_nmae']):.2f} ± {float(row['fresh_error']):.2f}"
            )
        lines.append(f"| {' | '.join(columns)} |")
    return lines


def exponents() -> list[str]:
    """Hurst exponents of generated surfaces beside those that were asked for."""
    lines: dict[tuple[str, str], list[str]] = {}
    for row in table("hurst/hurst.csv"):
        line = lines.setdefault((row["generator"], row["nodes"]), [])
        line.append(f"{float(row['hurst']):.2f} ± {float(row['deviation']):.2f}")
    return [
        f"| `{generator}` | {nodes} | {' | '.join(columns)} |"
        for (generator, nodes), columns in lines.items()
    ]


def asked() -> list[str]:
    """Return what is asked and what is measured, as at the top of the page."""
    lines_of_page = answers(
        PARTS, Inputs(RESULTS, None, None, full=True), (*FIRST, *FURTHER)
    )
    return [f"| {line.question} | {line.answer} |" for line in lines_of_page]


def speed() -> list[str]:
    """Times of single steps at 129 x 129 nodes, and the growth of the convolutions."""
    rows = in_short(table("benchmarks/times.csv"), table("growth/growth.csv"))
    return [f"| {' | '.join(row)} |" for row in rows]


SOLVES = 64
"""Solves in a round of `solve paper`."""


def in_short(times: Sequence[Row], growth: Sequence[Row]) -> list[tuple[str, str, str]]:
    """Return the times of a contact's steps at 129 x 129 nodes, and the growth of the convolutions.

    Takes the rows of `times.csv` and of the table of `bench growth`; returns for each quantity its
    name, its median time with the spread of the middle half, and a ratio in words.
    """
    row_by_case = {(row["case"], row["size"]): row for row in times}

    def time(case: str, size: str = "paper", solves: int = 1) -> str:
        row = row_by_case[case, size]
        median = float(row["median_ms"]) / solves
        spread = float(row["spread_ms"]) / solves
        return f"{median:.2g} ms ± {spread:.1g}"

    def ratio(case: str, name: str) -> str:
        (value,) = re.findall(rf"{name} (\S+?)(?:;|$)", row_by_case[case, ""]["more"])
        return f"{float(value):.2g}"

    loose = "solve paper: 1e-06"
    default = "solve paper: 2e-07"
    force = "solve given force: force"
    few = "solve few in contact: 129-1.0"
    alone = "time_over_iterations_alone"
    bare = [
        f"{ratio(case, 'bare_convolutions_per_solve')} bare convolutions' time"
        for case in (loose, default)
    ]
    rungs = [
        ratio(f"solve ladder: {many}", "time_over_single_solves") for many in (161, 9, 41)
    ]
    longer = [
        ratio(force, f"{name}_over_given_delta") for name in ("time", "convolutions")
    ]
    first = (
        "contact solve, mean over the first 64 rows of `paper`, residual 1e-6 of Delta"
    )
    return [
        (first, time(loose, "", SOLVES), bare[0]),
        ("the same at the default residual, 2e-7", time(default, "", SOLVES), bare[1]),
        (
            "the first 16 by their force instead of Delta",
            *("", "{} times as long, {} times the convolutions".format(*longer)),
        ),
        (
            "1 % of the nodes in contact, dense algebra on these",
            *(time(few, ""), f"{ratio(few, alone)} of the time of iterations alone"),
        ),
        ("one convolution, double", time("convolution: float64"), ""),
        ("the same, single precision", time("convolution: float32"), ""),
        ("surface, diamond-square", time("generate: diamond-square"), ""),
        ("the 22 statistics", time("describe"), ""),
        (
            "a contact among 161 loads on one surface (9, 41 loads)",
            *("", "{} of a separate solve's time ({}, {})".format(*rungs)),
        ),
        _grown(growth),
    ]


def _grown(growth: Sequence[Row]) -> tuple[str, str, str]:
    """Return how convolutions grow from the smallest grid to the largest, in words."""
    sizes = sorted({int(row["nodes"]) for row in growth})
    last = [row for row in growth if int(row["nodes"]) == sizes[-1]]
    shares = ", ".join(f"{float(row['percent']):g}" for row in last)
    growths = ", ".join(f"{float(row['growth']):.2f}" for row in last)
    what = "convolutions of iterations alone per doubling of the nodes a side"
    grids = f"{sizes[0]} to {sizes[-1]:,}, at {shares} % contact"
    return f"{what}, {grids}", "", f"{growths} times as many"


def features() -> list[str]:
    """Scores of each feature set, of all splits together."""
    return [
        f"| {row['features']} | {int(row['trained']):,}"
        f" | {cells(row, 'nmse', 'nmae', 'r2')} |"
        for row in table("features/features.csv")
    ]


def yielding() -> list[str]:
    """Scores of surrogates of bodies that yield."""
    lines = []
    for row in table("features/yielding.csv"):
        ends = f"{float(row['least']):.2g} to {float(row['most']):.3g}"
        rows = f"{int(row['trained']):,}, {int(row['judged']):,}"
        inside = f"{100 * float(row['covered']):.1f}"
        scores_of_row = f"{float(row['nmae']):.2f} | {float(row['r2']):.3f}"
        lines.append(f"| {row['target']}, {ends} | {rows} | {scores_of_row} | {inside} |")
    return lines


@dataclass(frozen=True)
class PageTable:
    """A table of a page.

    Attributes
    ----------
    header : tuple of str
        Titles of the columns.
    lines : callable
        Returns the rows as lines of Markdown.
    sources : tuple of str
        Files in `bench/results` that the rows are made of.
    """

    header: tuple[str, ...]
    lines: Callable[[], list[str]]
    sources: tuple[str, ...]

    def markdown(self) -> str:
        """Return the whole table."""
        rule = "|" + "---|" * len(self.header)
        return "\n".join([f"| {' | '.join(self.header)} |", rule, *self.lines()])


TABLES = {
    "asked": PageTable(
        ("asked", "measured"),
        asked,
        (
            "accuracy/promises.csv",
            "accuracy/ratios.csv",
            "hertz/hertz.csv",
            "stability/models.csv",
            "stability/stability.csv",
            "stability/surfaces.csv",
            "calculix/calculix.csv",
            "cost/learning.csv",
            "peers/peers.csv",
            "peers/periodic.csv",
            "growth/growth.csv",
            "comparison/area/scores.csv",
            "coverage/coverage.csv",
            "scans/scans.csv",
            "grow/grow.csv",
            "cost/cost.csv",
        ),
    ),
    "peers": PageTable(
        (
            "CPU time over ours, `--deltas 5,15,25,35,45 --rounds 2`, H = 0.65",
            "129 nodes",
            "257 nodes",
            "513 nodes",
        ),
        peers,
        ("peers/peers.csv",),
    ),
    "growths": PageTable(
        (
            "nMAE [%]",
            "asked",
            "rows",
            "area: estimate, at most",
            "area, fresh rows",
            "force: estimate, at most",
            "force, fresh rows",
        ),
        growths,
        ("grow/grow.csv",),
    ),
    "models": PageTable(
        (
            "[%]",
            "nMSE",
            "nMAE",
            "nMaxE",
            "R2",
            "the paper's: nMSE",
            "nMAE",
            "nMaxE",
            "R2",
        ),
        models,
        ("comparison/area/scores.csv",),
    ),
    "hybrid": PageTable(
        (
            "nMSE, R2 [%], baselines",
            "`paper`",
            "`hybrid`",
        ),
        hybrid,
        (
            "comparison/area/scores.csv",
            "comparison-hybrid/area/scores.csv",
        ),
    ),
    "surrogates": PageTable(
        (
            "tested on: R2, nMAE [%]",
            "`paper`",
            "`dimensionless`",
            "`hybrid`",
        ),
        surrogates,
        ("generalisation/generalisation.csv",),
    ),
    "cost": PageTable(
        (
            "our solver, new surfaces",
            "`paper`",
            "`dimensionless`",
            "`hybrid`",
        ),
        cost,
        ("cost/cost.csv", "comparison/area/tuning-times.csv"),
    ),
    "scans": PageTable(
        (
            "kernel ridge, hybrid features",
            "area R2, nMAE [%]",
            "in the 90 % interval [%]",
            "flagged [%]",
            "of the others, in the interval [%]",
            "mean width [% of area]",
            "wrong rows, flagged ones",
            "wrong of those not flagged [‰]",
        ),
        scans,
        ("scans/scans.csv",),
    ),
    "searched": PageTable(
        (
            "model",
            "training rows",
            "candidates judged",
            "winner",
            "at an end of the values tried",
            "nMAE [%]",
            "the paper's",
            "R2 [%]",
            "the paper's",
        ),
        searched,
        ("search/area/scores.csv", "search/area/tuning.csv"),
    ),
    "exponents": PageTable(
        (
            "generator",
            "nodes a side",
            *(f"asked for {hurst}" for hurst in (0.3, 0.5, 0.7, 0.9)),
        ),
        exponents,
        ("hurst/hurst.csv",),
    ),
    "speed": PageTable(
        (
            "at 129 x 129 nodes, one core",
            "median ± spread of the middle half of the rounds",
            "",
        ),
        speed,
        ("benchmarks/times.csv", "growth/growth.csv"),
    ),
    "features": PageTable(
        (
            "features; kernel ridge, paper preset, areas to 16.56 %",
            "training rows",
            "nMSE [%]",
            "nMAE [%]",
            "R2 [%]",
        ),
        features,
        ("features/features.csv",),
    ),
    "yielding": PageTable(
        (
            "kernel ridge, H/E* 0.003 to 0.1",
            "training, test rows",
            "nMAE [%]",
            "R2 [%]",
            "in the 90 % interval [%]",
        ),
        yielding,
        ("features/yielding.csv",),
    ),
}
"""The tables that a page shows by `{result} NAME`."""


def preparation() -> str:
    """Return the steps of the preparation of maps as a table in Markdown."""
    lines = ["| option | what it does |", "|---|---|"]
    for name, key in keys(PREPARED).items():
        option = f"{as_option(name)} {key.metavar}".rstrip()
        lines.append(f"| `{option}` | {key.help} |")
    return "\n".join(lines)


def markdown_of(name: str) -> str:
    """Return a table by its name; `columns` are those of a database, `preparation` that of maps.

    Raises
    ------
    KeyError
        If there is no table of this name.
    """
    if name == "columns":
        return "\n".join(markdown_of_columns())
    return preparation() if name == "preparation" else TABLES[name].markdown()
