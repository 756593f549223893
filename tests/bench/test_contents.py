"""Tables of the page: few digits, and only columns that there are."""

import lzma
from pathlib import Path

import pytest
from page_parts import written

from bench.contents import Table, tabulated
from gen.runtime.errors import InputError


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ""),
        ("infinity", "infinity"),
        ("inf", "∞"),
        ("15878", "15,878"),
        ("0.30000000000000004", "0.3"),
        ("1.23456e-12", "1.235e-12"),
        ("some words", "some words"),
    ],
)
def test_numbers_are_short(text: str, expected: str, tmp_path: Path) -> None:
    data = written("data.csv", [["value", "other"], [text, 1]], tmp_path)
    assert tabulated(Table(data, "")).rows[0][0].text == expected


def test_tables_without_a_column_are_refused(tmp_path: Path) -> None:
    data = written("data.csv", [["value"], [1]], tmp_path)
    with pytest.raises(InputError, match="has no column nothing"):
        tabulated(Table(data, "", columns=("nothing",)))
    with pytest.raises(InputError, match="cannot be read as a table"):
        tabulated(Table(tmp_path / "none.csv", ""))


def test_a_compressed_table_is_read_as_the_table(tmp_path: Path) -> None:
    data = written("data.csv", [["value", "note"], [1.5, "a"]], tmp_path)
    plain = tabulated(Table(data, ""))
    (tmp_path / "data.csv.xz").write_bytes(lzma.compress(data.read_bytes()))
    data.unlink()
    assert tabulated(Table(data, "")) == plain
    (tmp_path / "data.csv.xz").write_bytes(b"no xz")
    with pytest.raises(InputError, match=r"data.csv.xz cannot be read"):
        tabulated(Table(data, ""))
