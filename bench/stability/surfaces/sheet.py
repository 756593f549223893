"""The table of surfaces: generators, then statistics."""

from bench.stability.case import sheet
from bench.stability.surfaces import generator_cases, statistics_cases

SHEET = sheet(
    "Generators and statistics",
    "surfaces.csv",
    (*generator_cases.cases(), *statistics_cases.cases()),
)
"""The table as it is run and shown."""
