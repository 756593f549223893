"""Settings of a preparation: what they mean, and what is refused with their names."""

from typing import Any

import pytest

from gen import cli
from gen.generators.scans import PreparationTable, ReadingTable
from gen.maps.settings import Reading, keys, markdown_table, said
from gen.runtime.errors import InputError


@pytest.mark.parametrize(
    ("text", "cutoffs"),
    [
        ("", (None, None)),
        ("2.5:80", (2.5, 80.0)),
        ("2.5:", (2.5, None)),
        (":80", (None, 80.0)),
        (" 1 : 2 ", (1.0, 2.0)),
    ],
)
def test_cutoffs(text: str, cutoffs: tuple[float | None, float | None]) -> None:
    assert Reading.of_options(filter=text).cutoffs() == cutoffs


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("", (-float("inf"), float("inf"))),
        ("-5:3", (-5.0, 3.0)),
        (":3", (-float("inf"), 3.0)),
        ("-5:", (-5.0, float("inf"))),
    ],
)
def test_kept_heights(text: str, kept: tuple[float, float]) -> None:
    assert Reading.of_options(mask=text).kept_heights() == kept


def test_settings_within_their_ranges_are_taken() -> None:
    Reading.of_options().check()
    Reading.of_options(despike=0.1, form=20, filter="1:2", downsample=2, mask="-1:1").check()
    Reading.of_options(level="quadratic", fill=True).check()


REFUSED: list[tuple[dict[str, Any], str]] = [
    *(({"mask": text}, "--mask") for text in ("5", "a:b", "3:-5", "nan:1", "1:2:3", "9" * 400)),
    *(({"filter": text}, "--filter") for text in (":", "80:2", "0:8", "inf:")),
    *(({"despike": number}, "--despike") for number in (0.0, float("nan"))),
    *(({"form": degree}, "--form") for degree in (0, 21)),
    ({"downsample": 1}, "--downsample"),
    ({"level": "up"}, "--level"),
    ({"level": "plane", "form": 3}, "--level plane and --form 3"),
]


@pytest.mark.parametrize(("settings", "word"), REFUSED)
def test_settings_out_of_their_ranges_are_refused(settings: dict[str, Any], word: str) -> None:
    with pytest.raises(InputError) as refusal:
        Reading.of_options(**settings).check()
    assert str(refusal.value).startswith(word)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 300


@pytest.mark.parametrize(("asked", "words"), [("option", "--fill-most"), ("key", "fill_most")])
def test_messages_are_in_the_words_of_who_asks(asked: Any, words: str) -> None:
    assert said("fill_most", asked) == words
    assert said("despike 7", asked) == ("--" * (asked == "option")) + "despike 7"
    with pytest.raises(InputError) as refusal:
        Reading(level="up", asked=asked).check()
    assert str(refusal.value).startswith(said("level 'up': give one of", asked))


def test_commands_scenes_and_the_manual_have_every_key(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Each key is declared once; what is not made of it is forgotten."""
    assert cli.main(["describe", "--help"]) == 0
    described = capsys.readouterr().out
    scanned = {"reading": ReadingTable, "preparation": PreparationTable}
    for table, model in scanned.items():
        assert list(model.model_fields) == list(keys(table))
        for name, key in keys(table).items():
            assert said(name, "option") in described
            assert model.model_fields[name].description == key.allowed
            assert table == "reading" or f"| `{said(name, 'option')}" in markdown_table()
