"""The table of models."""

from bench.stability.case import sheet
from bench.stability.models import fit_cases, part_cases

SHEET = sheet("The nine models", "models.csv", (*fit_cases.cases(), *part_cases.cases()))
"""The table as it is run and shown."""
