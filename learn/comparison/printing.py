"""The tables of a comparison as they are printed, with remarks below them.

The first table is like the paper's Table 4, the second one like its Table 3. The paper's numbers
are in brackets.
"""

from collections.abc import Iterator

import numpy as np

from gen.runtime.terminal import command_to_type, echo, print_columns
from learn.comparison import paper
from learn.comparison.folder import SearchReport
from learn.comparison.grid import LIBRARY_ROWS, space_of
from learn.comparison.tables import (
    NOT_SEARCHED,
    OUR_AREA,
    SCORES,
    WHY_BASELINE,
    TableRow,
    Tables,
    kind_text,
    no_better_than_constant,
    notes_on_scores,
    score_names,
    search_cells,
    settings_text,
    winner_of,
)
from learn.models import EVERY, default_model

WINNERS = {"optimum": "the paper's optimum", "baseline": "the baseline"}
"""Words for the winners of searches, by `winner_of`; other winners are printed as they are."""


def show(tables: Tables) -> None:
    """Print the tables of a target, and remarks about them.

    Parameters
    ----------
    tables : Tables
        The tables.
    """
    conditions = tables.comparison.conditions
    limit = ""
    if conditions.area_max is not None:
        limit = f", areas to {conditions.area_max:g} %"
    echo(
        f"{tables.folder.path}: {tables.target}, {conditions.train_rows} training rows,"
        f" {conditions.test_rows} test rows{limit}; {tables.comparison.threads} thread"
    )
    echo(
        "Scores on the test rows [%] with their intervals, times [s]; the paper's in brackets:"
    )
    scores = [SCORES[name] for name in score_names(tables.target)]
    numbers = (*scores, "fit", "test set", "one row")
    lines = [_line_of_scores(row, tables.target) for row in tables.rows]
    print_columns(lines, ("Model", "", *numbers), right=numbers)
    for note in notes_on_scores(tables):
        echo(note)
    _show_searches(tables)
    for remark in _remarks(tables):
        echo(remark)


def _line_of_scores(row: TableRow, target: str) -> list[str]:
    """Return the cells of a result in the table of scores and times.

    A cell of a score has our score, the paper's score in brackets, and the interval on a second
    line; the paper's score and the interval are left out if they are None. A result without scores
    has three cells only, the last of which is "failed".
    """
    kind = kind_text(row.model, row.kind)
    if row.is_baseline_that_won:
        kind = f"{row.kind}: baseline"
    cells = [row.title, kind]
    times = row.result.times
    if row.result.test is None or times is None:
        return [*cells, "failed"]
    for name in score_names(target):
        cell = f"{getattr(row.result.test, name):.2f}"
        if row.published is not None:
            cell += f" ({getattr(row.published, name):.2f})"
        if row.intervals is not None and name in row.intervals.by_score:
            interval = row.intervals.by_score[name]
            cell += f"\n{interval.low:.2f} to {interval.high:.2f}"
        cells.append(cell)
    fit = _seconds_text(times.fit)
    test = _seconds_text(times.test)
    if row.published is not None:
        published_fit, published_test = paper.TIMES[row.kind][row.model]
        fit += f" ({published_fit:.3g})"
        test += f" ({published_test:.3g})"
    return [*cells, fit, test, _seconds_text(times.row)]


def _show_searches(tables: Tables) -> None:
    """Print the table of the searches, if there are tuned models."""
    tuned = [row for row in tables.rows if row.kind == "tuned"]
    if not tuned:
        return
    echo(
        "Searches: means of R2 over the five folds of all rows [%], which decide; sum of the fits'"
        " times [s], the paper's tuning time in brackets:"
    )
    texts = ("Model", "Grid", "Searched", "Winner", "Best settings")
    numbers = ("R2", "baseline", "candidates", "differ", "fits", "of", "time")
    lines = [_line_of_search(row, tables.target) for row in tuned]
    print_columns(lines, (*texts, *numbers), right=numbers)


def _line_of_search(row: TableRow, target: str) -> list[str]:
    """Return the cells of a tuned model in the table of searches.

    A search without a winner has three cells only: its model, no grid, and the reason up to its
    first colon.
    """
    search = row.search
    if search is None:
        kind_of_failure = row.result.failure.partition(":")[0]
        return [row.title, "", kind_of_failure]
    seconds = ""
    if row.result.times is not None:
        seconds = _seconds_text(row.result.times.search)
    if target == OUR_AREA and row.model in paper.TUNING_SECONDS:
        seconds += f" ({paper.TUNING_SECONDS[row.model]:.0f})"
    winner = winner_of(search)
    cells = search_cells(row, search)
    return [
        row.title,
        search.grid,
        search.how,
        WINNERS.get(winner, winner),
        settings_text(row.result),
        _percent_text(cells.get("winner_r2")),
        _percent_text(cells.get("baseline_r2")),
        str(search.candidates),
        str(search.candidates_differing),
        str(search.fits),
        str(search.fits_nominal),
        seconds,
    ]


def _percent_text(value: object) -> str:
    """Write a number [%] with two decimals; "" for None, which stands for a missing cell."""
    if isinstance(value, int | float):
        return f"{value:.2f}"
    return ""


def _seconds_text(value: float | None) -> str:
    """Write a time [s]: three digits below 1000 s, whole seconds above; "" for None."""
    if value is None:
        return ""
    if value >= 1000:
        return f"{value:.0f}"
    return f"{value:.3g}"


def _remarks(tables: Tables) -> Iterator[str]:
    """Yield the lines below the tables.

    They are warnings of results that are no better than a constant, remarks on single results, and
    the result with the smallest nMAE if there are results of several models.
    """
    features = tables.comparison.conditions.features
    for useless in no_better_than_constant(tables):
        yield f"warning: {useless.message}"
    for row in tables.rows:
        yield from _remarks_on_result(row, features)
    models = {row.model for row in tables.scored}
    if len(models) > 1:
        best = min(tables.scored, key=_nmae)
        default = EVERY[default_model(features)].title
        fit = command_to_type("learn fit")
        yield (
            f"smallest nMAE: {best.title}, {kind_text(best.model, best.kind)}; {fit} takes"
            f" {default} unless told otherwise"
        )


def _nmae(row: TableRow) -> float:
    """Return the nMAE of a result on the test rows [%]; infinite for a result without scores."""
    if row.result.test is None:
        return np.inf
    return row.result.test.nmae


def _remarks_on_result(row: TableRow, features: str) -> Iterator[str]:
    """Yield remarks on one result.

    They are the reason why it has no scores, the meaning of its kind, or the outcome of its search.
    An ordinary baseline has none. `features` is the name of the feature set.
    """
    search = row.search
    if row.result.failure:
        yield f"{row.title}, {kind_text(row.model, row.kind)}: {row.result.failure}"
    elif row.kind == "library":
        yield (
            f"Its library fits amplitude and length of a Gaussian process ({LIBRARY_ROWS:,} rows at"
            " most here); the paper's, and ours, has a fixed kernel."
        )
    elif search is None:
        return  # An ordinary baseline needs no remark.
    elif winner_of(search) == NOT_SEARCHED:
        judged = f"{search.candidates_scored} candidates were judged"
        yield f"{row.title}: {NOT_SEARCHED}: {judged}, of {search.enough} at least"
    elif row.is_baseline_that_won:
        yield f"{row.title}: {WHY_BASELINE}"
    else:
        for remark in _remarks_on_ends(row, search, features):
            yield f"{row.title}: {remark}"


def _remarks_on_ends(row: TableRow, search: SearchReport, features: str) -> Iterator[str]:
    """Yield remarks on settings of a winner that are outside the grid, or at an end of all values.

    All values are those of the grid and those that the search tried beyond its ends. `features` is
    the name of the feature set.
    """
    values = space_of(row.model, features).values
    for name, value in row.result.settings.items():
        # A setting that the grid does not have is not outside the grid.
        values_of_grid = values.get(name, [value])
        is_number = isinstance(value, int | float)
        if is_number and value not in values_of_grid:
            yield f"{name} = {value} lies beyond the grid, where the search went on"
        if name in search.ends:
            yield f"{name} = {value} at an end of what was tried: a better one may lie beyond"
