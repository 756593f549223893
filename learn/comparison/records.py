"""The contents of a comparison folder's JSON files, checked whenever one of them is read."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from gen.runtime.documents import Document

MOST = 2**53
"""Largest number of rows, fits or candidates that is accepted."""

Count = Annotated[int, Field(ge=0, le=MOST)]
Seconds = Annotated[float, Field(ge=0, le=1e15)]
Score = Annotated[float, Field(ge=-1e30, le=1e30)]
Setting = bool | int | float | str | list[int] | None


class Conditions(Document):
    """The conditions of results: see `learn.comparison.folder.conditions`."""

    database_sha256: str
    target: str
    features: str
    inputs: list[str]
    normalisation: str
    target_scaling: str
    seed: Annotated[int, Field(ge=0, lt=2**32)]
    folds: Count
    train_rows: Count
    test_rows: Count
    versions: dict[str, str]
    area_max: Annotated[float, Field(gt=0, le=100)] | None


class Comparison(Document):
    """The file comparison.json."""

    conditions: Conditions
    unit: str
    threads: Count


class Scored(Document):
    """The four scores [%]; see `learn.metrics.Scores`."""

    nmse: Score
    nmae: Score
    nmaxe: Score
    r2: Score


class Times(Document):
    """Times of a fit and of its predictions [s]; null (once NaN) where the fit has failed."""

    model_config = ConfigDict(allow_inf_nan=True)

    fit: float | None
    fits: Count
    test: float | None
    row: float | None
    search: Seconds


class Search(Document):
    """The description of a search in the result of its winner."""

    how: str
    grid: str = "Table 2"
    rows: Count
    candidates: Count
    candidates_differing: Count
    candidates_scored: Count
    fits_nominal: Count
    fits: Count
    r2_folds: list[Score]
    winner: Literal["grid", "optimum", "baseline"] | None = None
    grid_r2_folds: list[Score] = Field(default_factory=list)
    optimum_r2_folds: list[Score] = Field(default_factory=list)
    baseline_r2_folds: list[Score] = Field(default_factory=list)
    baseline_fits: Count = 0
    failures: dict[str, Count]
    remarks: dict[str, Count]


class NoSearch(Document):
    """The empty object that a baseline has in place of a search."""

    model_config = ConfigDict(extra="forbid")


class Result(Document):
    """The files baseline/MODEL.json and tuned/MODEL.json."""

    model: str
    settings: dict[str, Setting]
    settings_key: str
    fitted: dict[str, str]
    test: Scored | None
    train: Scored | None
    failure: str
    remarks: list[str]
    search: Search | NoSearch
    times: Times

    @model_validator(mode="after")
    def _times_belong_to_scores(self) -> "Result":
        times = self.times.fit, self.times.test, self.times.row
        sound = all(each is not None and 0 <= each <= 1e15 for each in times)
        if self.test is not None and not sound:
            raise ValueError("there are scores without times of fit and predictions")
        return self


class Failure(Document):
    """The file tuned/MODEL.json where no candidate could be fitted."""

    model_config = ConfigDict(extra="forbid")

    model: str
    failure: str
    remarks: list[str]


class WholeGrid(Document):
    """The file whole-grid/MODEL.json: see `learn.comparison.estimate.Cost`."""

    model_config = ConfigDict(extra="forbid")

    grid: str
    seconds: Annotated[Seconds, Field(gt=0)]
    error: Seconds | None
    fits: Count
    of: Count
    rows: Count = 0


KINDS: dict[str, tuple[type[Document], ...]] = {
    "baseline": (Result,),
    "tuned": (Result, Failure),
    "whole-grid": (WholeGrid,),
}
"""The documents that each folder of results may hold."""
