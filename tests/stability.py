"""What every table of stiff and extreme cases has to be."""

from bench.stability.case import Case, run_case
from bench.stability.sheet import Sheet


def title(case: Case) -> str:
    """What a case is called among the tests."""
    return f"{case.family}: {case.name}"


def assert_passes(case: Case) -> None:
    """Every finding is within its bounds; the others are named."""
    result = run_case(case)
    assert result.passed, "; ".join(str(f) for f in result.findings if not f.passed)


def assert_in_order(sheet: Sheet) -> None:
    """Names are unique, and families stand together."""
    names = [(case.family, case.name) for case in sheet.cases]
    families = [family for family, _ in names]
    assert len(set(names)) == len(names)
    assert families == sorted(families, key=families.index)
