"""The questions about Asperity at the top of the page, with the measured answers.

Each answer is computed from the tables of one part of the page. The section of this part names the
command that made the tables. The answers to `FIRST` stand with their commands below the picture
that the page begins with; those to `FURTHER` follow.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from bench.files import is_there, named, read_table
from bench.record import Inputs, read
from bench.report import Part

Row = dict[str, str]
"""One line of a table: its texts by the names of the columns; empty texts are missing values."""

NOT_OTHERS = {"bem", "paper's NNLS"}
"""Names of the solvers of our own code in the comparisons with other solvers."""


@dataclass(frozen=True)
class Line:
    """A line at the top of the page: a question with its answer."""

    question: str
    answer: str  # whole sentences
    part: str  # name of the part of the page that the answer comes from
    command: str  # command that made the tables of the answer; empty without a record


def lines(
    parts: Sequence[Part], inputs: Inputs, questions: Sequence["Question"]
) -> list[Line]:
    """Answer the questions whose tables exist and contain the answer.

    Parameters
    ----------
    parts : sequence of Part
        Parts of the page.
    inputs : Inputs
        Inputs of the run, which have the folder of each part.
    questions : sequence of Question
        `FIRST` or `FURTHER`.

    Returns
    -------
    list of Line
        The answers, in the order of the questions.

    Raises
    ------
    InputError
        If a table or a record is damaged or cannot be read.
    """
    part_by_name = {part.name: part for part in parts}
    answered: list[Line] = []
    for question in questions:
        part = part_by_name.get(question.part)
        if part is None:
            continue
        answer = _answer(question, inputs.folder(part))
        if answer:
            line = Line(
                question=question.text,
                answer=answer,
                part=part.name,
                command=_command(part, inputs),
            )
            answered.append(line)
    return answered


def _answer(question: "Question", folder: Path) -> str:
    """Answer a question by the tables in the folder of its part; "" if they lack the answer."""
    rows: list[Row] = []
    for path in named(folder, question.tables):
        if is_there(path):
            rows += read_table(path)[1]
    if not rows:
        return ""
    # Tables of a short run may lack the rows of an answer, which raises one of these errors.
    with suppress(LookupError, ValueError):
        return question.answer(rows)
    return ""


def _command(part: Part, inputs: Inputs) -> str:
    """Return the command that made a part, as readers type it; "" without a record."""
    record = read(inputs.path(part))
    if record is None:
        return ""
    return inputs.portable(part, record.command)


def errors_asked_for(rows: list[Row]) -> str:
    """State the share of the areas that were within the error that was asked for.

    Parameters
    ----------
    rows : list of Row
        Rows of `promises.csv`, the report's table of what is promised.

    Returns
    -------
    str
        The answer, for an error of 3 % and one of 1 %.
    """
    row_of_promise = {row["promise"]: row for row in rows}
    shares: list[str] = []
    for percent in (3, 1):
        row = row_of_promise[f"area alone, asked to {percent} %: within [%]"]
        share = float(row["measured"])
        number = int(row["number"])
        shares.append(f"asked for {percent} %, {share:.1f} % of {number} areas")
    return f"Areas within the error: {'; '.join(shares)}."


def times_of_others(rows: list[Row]) -> str:
    """State how much longer the fastest other solver takes until its area is within an error.

    Parameters
    ----------
    rows : list of Row
        Rows of `ratios.csv`, the times of other solvers over ours. Means over all surfaces are
        compared: those over measured grids leave out the surfaces that need the finest grids.

    Returns
    -------
    str
        The answer, for an error of 3 % and one of 1 %. It says on how many of the surfaces the time
        is extrapolated.
    """
    ratios: list[str] = []
    for percent in (3, 1):
        of_percent = [row for row in rows if float(row["within_percent"]) == percent]
        fastest = min(of_percent, key=lambda row: float(row["all_times_ours"]))
        ratio = float(fastest["all_times_ours"])
        surfaces = fastest["all_surfaces"]
        extrapolated = int(fastest["extrapolated_surfaces"])
        basis = f"{fastest['way']}, {surfaces} surfaces"
        if extrapolated:
            basis += f", {extrapolated} of them extrapolated"
        ratios.append(f"{ratio:.2g} times our time for {percent} % ({basis})")
    return (
        f"The fastest other solver takes {' and '.join(ratios)}. Our time includes the search"
        " for the grid and the bar."
    )


def hertz(rows: list[Row]) -> str:
    """State the error of the force on the finest grid at the largest displacement of a sphere.

    Parameters
    ----------
    rows : list of Row
        Rows of `hertz.csv`.

    Returns
    -------
    str
        The answer.
    """
    deepest = max(float(row["delta_um"]) for row in rows)
    at_deepest = [row for row in rows if float(row["delta_um"]) == deepest]
    (exact,) = (
        float(row["force_uN"]) for row in at_deepest if row["solution"] == "hertz"
    )
    forces = {
        int(float(row["nodes"])): float(row["force_uN"])
        for row in at_deepest
        if row["solution"] == "uniform-pressure"
    }
    finest = max(forces)
    error = 100 * abs(forces[finest] / exact - 1)
    return (
        f"The force on a sphere is within {error:.2g} % of Hertz's, {finest} nodes a side,"
        f" pressed in by {deepest:g} µm."
    )


def beside_others(case: str, rows: list[Row]) -> str:
    """State how much longer than ours the fastest other solver takes.

    The fastest other solver is chosen for each case. The answer has the lowest and the highest
    ratio of its time to ours over all cases.

    Parameters
    ----------
    case : str
        Names of the columns that tell the cases apart, with blanks between them.
    rows : list of Row
        Rows of the comparison with other solvers.

    Returns
    -------
    str
        The answer.
    """
    columns = case.split()
    fastest: dict[tuple[str, ...], float] = {}
    for row in rows:
        if row["times_ours"] and row["solver"] not in NOT_OTHERS:
            key = tuple(row[column] for column in columns)
            ratio = float(row["times_ours"])
            fastest[key] = min(fastest.get(key, ratio), ratio)
    lowest = min(fastest.values())
    highest = max(fastest.values())
    return f"The fastest other solver takes {lowest:.2g} to {highest:.2g} times our time."


def stability(rows: list[Row]) -> str:
    """State how many of the stiff and extreme cases pass.

    Parameters
    ----------
    rows : list of Row
        Rows of all tables of cases.

    Returns
    -------
    str
        The answer.
    """
    passed = [row for row in rows if row["verdict"] == "passed"]
    return f"{len(passed)} of {len(rows)} stiff and extreme cases pass."


def growth(rows: list[Row]) -> str:
    """State the largest factor by which convolutions grow from the smallest grid to the largest.

    Parameters
    ----------
    rows : list of Row
        Rows of `growth.csv`.

    Returns
    -------
    str
        The answer.
    """
    sizes = {int(row["nodes"]) for row in rows}
    finest = max(sizes)
    on_finest = [row for row in rows if int(row["nodes"]) == finest]
    largest = max(float(row["growth"]) for row in on_finest)
    return (
        f"From {min(sizes)} to {finest:,} nodes a side the convolutions of a solve grow by a"
        f" factor of {largest:.2g} at most."
    )


def comparison(rows: list[Row]) -> str:
    """State R2 of the best of the nine models with the paper's features, and of the paper's best.

    Parameters
    ----------
    rows : list of Row
        Rows of the comparison's scores of the area.

    Returns
    -------
    str
        The answer; empty if no model has a score. It does not mention the paper's best if the table
        has no scores of the paper.
    """
    ours = _best(rows, "r2")
    if ours is None:
        return ""
    r2 = float(ours["r2"])
    answer = (
        f"With a split by surfaces, the best of nine models ({ours['model']}) reaches R2"
        f" {r2:.2f} % of the area"
    )
    papers = _best(rows, "paper_r2")
    if papers is None:
        return f"{answer}."
    score = float(papers["paper_r2"])
    return f"{answer}; the paper's best ({papers['model']}) has {score:.2f} %."


def _best(rows: list[Row], score: str) -> Row | None:
    """Return the row with the highest score; None if no row has that score."""
    scored = [row for row in rows if row[score]]
    return max(scored, key=lambda row: float(row[score]), default=None)


def exactness(rows: list[Row]) -> str:
    """State the errors of the area with hybrid features, learnt from the most rows.

    Parameters
    ----------
    rows : list of Row
        Rows of `learning.csv`.

    Returns
    -------
    str
        The answer.
    """
    hybrid = [row for row in rows if row["features"] == "hybrid"]
    best = max(hybrid, key=lambda row: int(row["trained"]))
    nmae = float(best["nmae"])
    r2 = float(best["r2"])
    trained = int(best["trained"])
    return (
        f"New surfaces of the same kind: nMAE {nmae:.2f} % of the area, R2"
        f" {r2:.2f} %, learnt from {trained:,} rows."
    )


def coverage(rows: list[Row]) -> str:
    """State for how many shifted populations and targets the intervals hold as promised.

    Also state the smallest coverage of rows without a flag. Of populations in which nearly all rows
    are flagged, state only the number.

    Parameters
    ----------
    rows : list of Row
        Rows of `coverage.csv`.

    Returns
    -------
    str
        The answer.
    """
    judged = [row for row in rows if "flagged" not in row["verdict"]]
    met = [row for row in judged if row["verdict"].startswith("met")]
    worst = min(judged, key=lambda row: float(row["covered_unflagged"]))
    share = 100 * float(worst["covered_unflagged"])
    flagged = len(rows) - len(judged)
    return (
        f"In {len(met)} of {len(judged)} shifted populations and targets 90 % intervals hold at"
        f" least 86 % of the rows without a flag, to within the error. Least, {share:.0f} %:"
        f" {worst['target']} of '{worst['tested_on']}', learnt from '{worst['trained_on']}'. In"
        f" {flagged} more nearly all rows are flagged."
    )


def scans(rows: list[Row]) -> str:
    """State the errors on tiles of maps that were not trained on, for each size of window.

    Parameters
    ----------
    rows : list of Row
        Rows of `scans.csv`.

    Returns
    -------
    str
        The answer; empty if there are no rows about all maps.
    """
    of_all_maps = [
        row for row in rows if row["left_out"] == "unseen tiles" and row["map"] == "all"
    ]
    if not of_all_maps:
        return ""
    of_all_maps.sort(key=lambda row: int(row["nodes"]))
    sizes: list[str] = []
    for row in of_all_maps:
        r2 = float(row["r2"])
        nmae = float(row["nmae"])
        nodes = row["nodes"]
        sizes.append(f"{nodes} nodes a side: R2 {r2:.2f} %, nMAE {nmae:.2g} %")
    return f"Parts of maps that were not trained on: {'; '.join(sizes)}."


def grow(rows: list[Row]) -> str:
    """State in how many cases fresh surfaces have at most the error that was asked for.

    Parameters
    ----------
    rows : list of Row
        Rows of `grow.csv`.

    Returns
    -------
    str
        The answer.
    """
    held = [row for row in rows if float(row["fresh_nmae"]) <= float(row["asked"])]
    return (
        f"The accuracy asked for holds on fresh surfaces in {len(held)} of {len(rows)}"
        " cases."
    )


def cost(rows: list[Row]) -> str:
    """State from how many contacts a surrogate costs less than solving them.

    Training rows are paid for. The setting is new surfaces, our solver and hybrid features.

    Parameters
    ----------
    rows : list of Row
        Rows of `cost.csv`.

    Returns
    -------
    str
        The answer.
    """
    setting = {"asked": "new surfaces", "solver": "ours", "features": "hybrid"}
    (row,) = (row for row in rows if setting.items() <= row.items())
    contacts = int(row["break_even"])
    trained = int(row["rows"])
    ratio = float(row["query"]) / float(row["solve"])
    return (
        f"From {contacts:,} contacts of new surfaces on, with"
        f" {trained:,} rows to train on; an answer takes"
        f" {ratio:.2g} of the time of a solve."
    )


def laws(rows: list[Row]) -> str:
    """State how closely a finite-element program meets the tables of laws that it reads.

    Parameters
    ----------
    rows : list of Row
        Rows of `calculix.csv`, whose columns `..._off` are relative differences.

    Returns
    -------
    str
        The answer.
    """
    differences = [
        abs(float(row[name])) for row in rows for name in row if name.endswith("_off")
    ]
    largest = 100 * max(differences)
    return (
        f"Closure, pressure and temperature jump in CalculiX are those of the table within"
        f" {largest:.1g} %, at {len(rows)} points."
    )


FREE = partial(beside_others, "nodes hurst delta_um")
"""Takes rows of `peers.csv`, and states the time of other solvers on free patches."""

PERIODIC = partial(beside_others, "nodes hurst mean_pressure")
"""Takes rows of `periodic.csv`, and states the time of other solvers on periodic patches."""


@dataclass(frozen=True)
class Question:
    """A question, and the tables and the function that give its answer."""

    text: str  # the question
    part: str  # name of the part of the page whose tables give the answer
    tables: str  # file of the table in the folder of the part, or a pattern with * for several
    # Takes all rows of the tables; returns the answer, or "" if the rows lack it.
    answer: Callable[[list[Row]], str]


FIRST = (
    Question(
        text="Is an error that is asked for kept?",
        part="accuracy",
        tables="promises.csv",
        answer=errors_asked_for,
    ),
    Question(
        text="How long do other solvers take to the same error?",
        part="accuracy",
        tables="ratios.csv",
        answer=times_of_others,
    ),
    Question(
        text="How exact is a contact beside a closed form?",
        part="hertz",
        tables="hertz.csv",
        answer=hertz,
    ),
    Question(
        text="Does it bear stiff and extreme cases?",
        part="stability",
        tables="*.csv",
        answer=stability,
    ),
    Question(
        text="Do finite elements get what the law says?",
        part="calculix",
        tables="calculix.csv",
        answer=laws,
    ),
    Question(
        text="How exact is a surrogate?",
        part="cost",
        tables="learning.csv",
        answer=exactness,
    ),
)
"""The six questions at the top of the page, in their order."""

FURTHER = (
    Question(
        text="How long do other solvers take to the same force?",
        part="peers",
        tables="peers.csv",
        answer=FREE,
    ),
    Question(
        text="And on periodic patches?",
        part="periodic",
        tables="periodic.csv",
        answer=PERIODIC,
    ),
    Question(
        text="Do fine grids cost more steps?",
        part="growth",
        tables="growth.csv",
        answer=growth,
    ),
    Question(
        text="How near do its models come to the paper's?",
        part="comparison",
        tables="area/scores.csv",
        answer=comparison,
    ),
    Question(
        text="Does a surrogate know what it does not know?",
        part="coverage",
        tables="coverage.csv",
        answer=coverage,
    ),
    Question(
        text="What of measured maps?",
        part="scans",
        tables="scans.csv",
        answer=scans,
    ),
    Question(
        text="Does a surrogate grow to the accuracy asked for?",
        part="grow",
        tables="grow.csv",
        answer=grow,
    ),
    Question(
        text="When does a surrogate pay?",
        part="cost",
        tables="cost.csv",
        answer=cost,
    ),
)
"""The further questions, in the order of the page."""
