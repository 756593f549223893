"""The table of small faults fits the code: `python -m tests.mutation` has the tests find them."""

import ast

import pytest

from tests.mutation import ROOT, faults, stages


@pytest.mark.parametrize(
    "fault", faults(), ids=lambda each: f"{each.file}: {each.old.strip()}"
)
def test_every_fault_fits_the_code(fault):
    text = (ROOT / fault.file).read_text(encoding="utf-8")
    assert text.count(fault.old) == 1
    ast.parse(text.replace(fault.old, fault.new))


def test_there_are_sixty_faults_and_tests_beside_them():
    assert len(faults()) == 60
    found = [each[0] for each in stages("gen/runtime/files.py", everything=False)]
    assert found == ["tests/gen/runtime/test_files.py", "tests/gen", "tests"]
