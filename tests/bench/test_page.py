"""The page shows what the parts hold, as it is, and stands alone."""

import base64
import json
import re
from dataclasses import replace

import pytest
from page_parts import WRITE, inputs, makes, part, written

from bench.contents import Figure, Table, Words
from bench.page import states, write_page
from bench.picture import new_figure, save
from bench.record import Machine, Record, code_state
from bench.report import Part


def without_file(folder):
    return [Table(folder / "none.csv", "Nothing.")]


def test_a_part_that_cannot_be_shown_does_not_hide_the_others(tmp_path):
    one = Part("one", "First", "No table", WRITE, WRITE, without_file)
    two, three = part("two", WRITE), part("three", "-m bench hertz -o {folder}")
    makes(tmp_path, [one, two])
    (tmp_path / "three").mkdir()
    (tmp_path / "three" / "made.txt").write_text("by hand")
    text = write_page([one, two, three], inputs(tmp_path)).read_text(encoding="utf-8")
    assert "none.csv: cannot be read as a table" in text
    assert "<p>x</p>" in text
    assert "<p>by hand</p>" in text
    assert "No record says when, where and by which command this was made" in text
    assert "bench hertz" not in text


@pytest.mark.parametrize("installed", [True, False])
def test_captions_say_which_packages_were_missing(tmp_path, *, installed):
    """Packages alone: records do not tell which programs there were."""
    one = replace(part("one", WRITE), needs=("tamaas", "mpiexec"), show=contents)
    makes(tmp_path, [one])
    path = inputs(tmp_path).path(one)
    record = json.loads(path.read_text(encoding="utf-8"))
    record["versions"].pop("tamaas", None)
    if installed:
        record["versions"]["tamaas"] = "2.9.0"
    path.write_text(json.dumps(record), encoding="utf-8")
    text = write_page([one], inputs(tmp_path)).read_text(encoding="utf-8")
    sentence = "A line that falls. Without tamaas: not installed where this was made."
    assert (sentence in text) is not installed


def test_the_page_begins_with_the_picture_of_errors_over_times(tmp_path):
    first = Part("accuracy", "Chapter", "Errors", WRITE, WRITE, contents)
    makes(tmp_path, [first])
    text = write_page([first], inputs(tmp_path)).read_text(encoding="utf-8")
    header = text.partition("<nav")[0]
    assert header.count("<img ") == 1
    assert "Error of the contact area over the CPU time" in header
    assert "Further answers" not in header


def test_page_says_which_parts_are_of_another_state():
    def of(state):
        made = {"command": "", "inputs": {}, "created": "", "commit": "", "versions": {}}
        return Record(**made, machine=Machine(processor=""), state=state)

    assert states([]) == ""
    assert states([None, of("b"), of("a" * 64), of("a" * 64)]) == (
        "Parts by the state of the code: 2 of aaaaaaaaaa, 1 of an unknown one, 1 of b."
    )


def contents(folder):
    """One of each kind, wide and long."""
    figure = new_figure(16, 4)
    figure.subplots().plot([0, 1], [1, 0])
    data = written("data.csv", [["delta_um", "r2"], [0.1 + 0.2, 1]], folder)
    wide: list[list[object]] = [
        [f"column_{i}" for i in range(30)],
        [1.5 * i for i in range(30)],
    ]
    cases: list[list[object]] = [
        ["case", "error", "verdict"],
        ["<b>bold</b> & plain", "1e-15", "passed"],
        ["bad one", "nan", "failed: too far"],
    ]
    return [
        Figure(save(figure, folder / "wide.png"), "A line that falls.", data=(data,)),
        Table(data, "Two numbers: `delta` and its `r2` < 1."),
        Table(written("wide.csv", wide, folder), "Very wide."),
        Table(written("cases.csv", cases, folder), "Cases.", verdict="verdict"),
        Words("First line,\n  then " + "x" * 500, typed=True),
        Words("y" * 500),
    ]


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """A page with everything on it."""
    folder = tmp_path_factory.mktemp("page")
    one = Part("one", "First", "All kinds", WRITE, WRITE, contents)
    two = Part("two", "Second", "Not made", "", WRITE, without_file)
    makes(folder, [one])
    return write_page([one, two], inputs(folder))


@pytest.fixture(scope="module")
def text(shown):
    """The text of that page."""
    return shown.read_text(encoding="utf-8")


def test_page_stands_alone(text):
    addresses = re.findall(r'(?:src|href)="([^"]*)"', text)
    assert addresses
    assert all(address.startswith(("data:", "#")) for address in addresses)
    assert not re.search(r"@import|<script|url\(", text)


def test_page_holds_tables_with_all_digits(shown, text):
    (source,) = set(
        re.findall(r'download="data.csv" href="data:text/csv;base64,([^"]*)"', text)
    )
    data = base64.b64decode(source)
    assert data == (shown.parent / "one" / "data.csv").read_bytes()
    assert b"0.30000000000000004" in data
    assert ">0.3<" in text


def test_code_in_captions_is_shown_as_code(text):
    assert "Two numbers: <code>delta</code> and its <code>r2</code> &lt; 1." in text
    assert 'aria-label="Two numbers: delta and its r2 &lt; 1."' in text


def test_page_marks_and_counts_rows_that_failed(text):
    assert text.count('<tr class="failed">') == 1
    assert re.search(r'Rows with a verdict:\s+2 in <a href="#one">All kinds</a>;\s', text)
    assert "1 failed" in text


def test_page_lists_the_parts_that_were_not_made(text):
    assert text.index("All kinds") < text.index("1 more reports are not here")
    assert "<li><code>two</code>: Not made</li>" in text
    assert "(not here)" not in text


def test_page_shows_what_there_is_as_it_is(text):
    assert f"Parts by the state of the code: 1 of {code_state()[:10]}." in text
    assert "&lt;b&gt;bold&lt;/b&gt; &amp; plain" in text
    assert 'alt="A line that falls."' in text
    assert "delta [µm]" in text


@pytest.mark.few(1)
@pytest.mark.parametrize("width", [360, 1440])
def test_browser_shows_the_page_without_error_or_overflow(shown, width):
    from browser import look

    seen = look(shown, width)
    assert seen.complaints == []
    assert seen.content_width <= width
    assert seen.broken_pictures == 0
    assert seen.shown_pictures == 1
    # Of 150 dots an inch: letters of ten points have ten pixels on a phone, nine on a desk.
    assert seen.smallest_scale >= (0.499 if width < 640 else 0.45)
    assert seen.clipped_code == 0
