"""Texts of scenes: templates and TOML's notation."""

import pytest

from gen.draft.writing import filled, quoted
from gen.runtime.errors import InputError


def test_a_line_of_an_empty_text_alone_is_left_out():
    template = "a = $a\n$b\nb = [$b]\n"
    assert filled(template, {"a": "1", "b": ""}) == "a = 1\nb = []\n"


def test_texts_of_several_lines_with_signs_of_the_template_stay_as_they_are():
    assert filled("$a\nc\n", {"a": "x\n$b"}) == "x\n$b\nc\n"


def test_one_empty_line_stays_of_several():
    assert filled("a\n\n$b\n\nc\n", {"b": ""}) == "a\n\nc\n"


def test_a_name_that_utf_8_cannot_hold_is_refused():
    with pytest.raises(InputError, match="rename"):
        quoted("scan-\udcff.x3p")
