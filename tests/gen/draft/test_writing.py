"""TOML with comments is read as it was meant, whatever texts stand in it."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen.draft.writing import WIDTH, Key, document, number, quoted, rounded, span
from gen.runtime.errors import InputError

TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=300)


@given(TEXTS, TEXTS, st.floats(allow_nan=False, allow_infinity=False))
def test_values_come_back_and_comments_stay_comments(text, comment, value):
    written = document(
        [
            Key(comment),
            Key(comment, "first", quoted(text)),
            Key(comment, "[table]"),
            Key(comment, "second", number(value)),
            Key("", "third", span(1.0, 2e300)),
        ]
    )
    table = {"second": value, "third": [1.0, 2e300]}
    assert tomllib.loads(written) == {"first": text, "table": table}


def test_long_comments_are_wrapped_and_commands_keep_their_indentation():
    written = document([Key("word " * 100 + "\n    python -m gen", "a", "1"), Key("", "b", "2")])
    lines = written.splitlines()
    assert max(map(len, lines)) <= WIDTH + 2
    assert lines[-3:] == ["#     python -m gen", "a = 1", "b = 2"]


def test_names_that_are_no_text_are_refused():
    with pytest.raises(InputError, match="rename"):
        quoted("scan-\udcff.x3p")


def test_rounding_keeps_significant_digits():
    assert [rounded(1234.5), rounded(0.0012345), rounded(1234.5, 3)] == [1200.0, 0.0012, 1230.0]
