"""Surrogates' files from anywhere: damage and malice are one line, no crash and no wrong number."""

import math
import os
import pickle
import sys
from itertools import cycle

import crafted_surrogates
import crafted_surrogates as crafted
import numpy as np
import pytest

from gen.runtime.errors import InputError
from learn import Surrogate, cli
from learn.executor import Executor
from learn.request import Request
from learn.surrogate import forest, training
from learn.surrogate.forest import Tree

MUTANTS = 28


@pytest.fixture
def path(tmp_path):
    return tmp_path / "x.surrogate"


@pytest.fixture(scope="module")
def verdicts():
    """What became of all mutants, by name."""
    scalings = dict(zip(crafted.FEW, cycle(crafted.SCALINGS)))
    names = [
        (model, scalings[model], way, number)
        for model in crafted.FEW
        for way in ("damaged", "crafted")
        for number in range(MUTANTS)
    ]
    return crafted.judged(names)


def test_no_file_ends_the_process_or_hangs(verdicts):
    assert len(verdicts) >= 500
    wrong = [each for each in verdicts if {"ended", "hangs", "raised"} & each[1].keys()]
    assert not wrong


def test_damage_is_always_seen(verdicts):
    said = [found["refused"] for name, found in verdicts if name[2] == "damaged"]
    assert len(said) == MUTANTS * len(crafted.FEW)
    assert all(each.isprintable() and "x.surrogate" in each for each in said)


def test_crafted_files_are_refused_or_answer_with_numbers(verdicts):
    found = [each for name, each in verdicts if name[2] == "crafted"]
    refused = [each["refused"] for each in found if "refused" in each]
    assert len(refused) > len(found) / 2
    assert all(each.isprintable() for each in refused)
    for each in found:
        for values in each.get("values", ()):
            for value, inside in zip(values, each["inside"], strict=True):
                assert math.isfinite(value) or not inside


def test_the_judge_sees_files_that_end_the_process_or_hang(tmp_path):
    import subprocess

    for code, wanted in (
        ("import os; os.kill(os.getpid(), 11)", {"ended": -11}),
        ("import time; time.sleep(60)", {"hangs": 0.5}),
    ):
        said = tmp_path / "said"
        said.touch()
        with subprocess.Popen([sys.executable, "-S", "-c", code]) as child:
            assert crafted.watched(child, said, 0.5 if "hangs" in wanted else 30) == wanted


def spoilt(model, change, scaling="standard"):
    """A file with something changed in card and parts, its checksum right."""
    card, parts = crafted.content(crafted.whole(model, scaling))
    change(card, parts, parts["targets"]["area"], parts["targets"]["area"]["model"])
    return crafted.written(card, parts)


def put(place, name, value):
    """Change an entry: of 0 the card, 1 the parts, 2 the target's, 3 the model's."""

    def change(*where):
        where[place][name] = value

    return change


def at(name, place, value):
    """Change one number of an array of the model, or of its trees."""

    def change(card, parts, target, model):
        owner = model["trees"] if name not in model else model
        owner[name] = owner[name].copy()
        owner[name].reshape(-1)[place] = value

    return change


LIES = {
    "a child before its parent": ("decision-tree", at("left", 2, 1), "child"),
    "a child beyond the tree": ("random-forest", at("right", 0, 10_000), "child"),
    "a child of two": ("gradient-boost", at("right", 0, 1), "child of several"),
    "one child": ("adaboost", at("right", 0, -1), "one child"),
    "a loop": ("xgboost", at("left", 1, 0), "child"),
    "a feature too many": ("xgboost", at("feature", 0, 23), "none of 23"),
    "a feature below 0": ("decision-tree", at("feature", 0, -5), "none of 23"),
    "no number to split at": ("random-forest", at("number", 0, np.nan), "not finite"),
    "an infinite leaf": ("xgboost", at("number", -1, np.inf), "not finite"),
    "more nodes than there are": ("gradient-boost", at("nodes", 0, 10**6), "shape"),
    "nodes below 0": ("gradient-boost", at("nodes", 0, -(2**31)), "shape"),
    "weights that are none": ("kernel-ridge", at("weights", 3, np.nan), "not finite"),
    "an infinite support vector": ("svm", at("vectors", 3, np.inf), "not finite"),
    "an unknown kernel": ("svm", put(3, "kernel", "precomputed"), "kernel"),
    "a kernel of another model": ("kernel-ridge", put(3, "kernel", "poly"), "kernel"),
    "a degree without end": ("svm", put(3, "degree", 10**9), "degree"),
    "a weight below 0": ("adaboost", at("weights", 0, -1.0), "below 0"),
    "a length of 0": ("gaussian-process", at("lengths", 0, 0.0), "above 0"),
    "no noise": ("gaussian-process", put(3, "noise", 0), "noise"),
    "an unknown activation": ("mlp", put(3, "activation", "softmax"), "activation"),
    "no layers": ("mlp", put(3, "weights", []), "no layers"),
    "layers that do not fit": (
        "mlp",
        lambda card, parts, target, model: model["weights"].reverse(),
        "weights",
    ),
    "an infinite scale": (
        "kernel-ridge",
        put(2, "scaling", {"offset": np.zeros(23), "scale": np.full(23, np.inf)}),
        "not finite",
    ),
    "a scale without end": (
        "kernel-ridge",
        put(2, "scaling", {"offset": np.zeros(23), "scale": np.full(23, 1e300)}),
        "not that of the training",
    ),
    "a scale of 0": (
        "mlp",
        put(2, "scaling", {"offset": np.zeros(23), "scale": np.zeros(23)}),
        "not above 0",
    ),
    "an infinite deviation": ("svm", put(2, "deviation", math.inf), "deviation"),
    "a mean that is none": ("svm", put(2, "mean", math.nan), "mean"),
    "scores out of order": ("svm", put(2, "scores", [np.arange(10.0)[::-1]]), "in order"),
    "too few scores": ("svm", put(2, "scores", [np.arange(9.0)]), "from 9 rows"),
    "another model": ("svm", put(0, "model", "mlp"), "weights"),
    "another target": ("svm", put(0, "targets", {"force": {}}), "force"),
    "another modulus": ("svm", put(0, "modulus", 2.0), "modulus is 2.0, 1.0 in the scene"),
    "another side": ("svm", put(0, "side", 500.0), "side"),
    "other features": ("svm", put(0, "features", "paper"), "columns"),
    "another scaling": ("svm", put(0, "normalisation", "min-max"), "scaling"),
    "other rows": ("kernel-ridge", put(0, "rows", {"train": 1}), "calibration"),
    "no scene": ("kernel-ridge", put(0, "scene", "samples = 3"), "scene"),
    "errors that shrink with the distance": ("svm", put(2, "growth", -1.0), "growth is -1.0"),
    "errors that grow without end": ("svm", put(2, "growth", 1e9), "growth is"),
    "a growth without distances": (
        "svm",
        lambda card, parts, *others: parts.pop("distance"),
        "distances that are missing",
    ),
    "distances from nothing": (
        "svm",
        lambda card, parts, *others: parts["distance"].update(
            centres=np.empty((0, 23)), whitenings=np.empty((0, 23, 23))
        ),
        "distances from nothing",
    ),
    "ends in another order": ("svm", put(1, "low", np.full(23, 1e9)), "belong together"),
}


@pytest.mark.parametrize("lie", LIES)
def test_lies_are_named_in_one_line(path, lie, capsys):
    model, change, word = LIES[lie]
    path.write_bytes(spoilt(model, change))
    with pytest.raises(InputError, match=r"x\.surrogate: is not whole") as caught:
        Surrogate.load(path)
    assert word in str(caught.value)
    for command in (["card"], ["predict", "-", "--delta", "5"], ["law", "quick", "--csv", "x.csv"]):
        assert cli.main([command[0], str(path), *command[1:]]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert word in said


@pytest.mark.parametrize(
    "arrays",
    [
        [["<f8", [2**62, 2**62]]],
        [["<f8", [10**9]]],
        [["<f8", [-1]]],
        [["<f8", ["a"]]],
        [["<f8", [True]]],
        [["|O", [1]]],
        [["<f8", 3]],
        [],
        None,
        [["<f8", [0]]] * 3,
    ],
)
def test_arrays_that_are_not_there_are_refused_before_memory_is_asked_for(path, arrays):
    text = crafted.json.dumps({"card": {}, "parts": {"low": {"array": 0}}, "arrays": arrays})
    path.write_bytes(crafted.sealed(crafted.padded(text.encode(), b" "), [np.zeros(1)]))
    with pytest.raises(InputError, match=r"x\.surrogate"):
        Surrogate.load(path)


@pytest.mark.parametrize(
    "text", [b"[" * 80_000, b'{"a":' * 80_000, b"\xff", b"{}", b"[]", b"9" * 5000, b"null"]
)
def test_texts_that_are_none_are_refused(path, text):
    path.write_bytes(crafted.sealed(crafted.padded(text, b" "), []))
    with pytest.raises(InputError, match=r"x\.surrogate") as caught:
        Surrogate.load(path)
    assert "\n" not in str(caught.value)


def test_a_text_longer_than_the_file_is_refused(path):
    path.write_bytes(crafted.signed((2**40).to_bytes(8, "little") + b"{}"))
    with pytest.raises(InputError, match="a text of"):
        Surrogate.load(path)


def test_trees_deeper_than_any_fit_makes_are_refused_in_time():
    size = 2 * 10**5 + 1
    inner = np.arange(0, size - 2, 2, dtype="i4")
    left, right = np.full(size, -1, dtype="i4"), np.full(size, -1, dtype="i4")
    left[inner], right[inner] = inner + 1, inner + 2
    tree = Tree(left, right, np.zeros(size, dtype="i4"), np.zeros(size))
    with pytest.raises(ValueError, match="deeper"):
        list(forest.unpacked(forest.packed([tree], "f8"), "f8", 3))


def test_loading_imports_and_runs_nothing_that_a_file_names(path, tmp_path, monkeypatch):
    (tmp_path / "landmine.py").write_text("from pathlib import Path\nPath('trace').touch()\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    card, parts = crafted.content(crafted.whole("svm"))
    card["model"] = parts["__class__"] = "landmine.Landmine"
    card["__module__"] = card["__reduce__"] = "landmine"
    path.write_bytes(crafted.written(card, parts))
    with pytest.raises(InputError, match="model is"):
        Surrogate.load(path)
    assert "landmine" not in sys.modules
    assert not (tmp_path / "trace").exists()


@pytest.mark.parametrize("key", ["title", "rows", "targets", "versions", "columns", "delta"])
def test_a_card_that_lacks_something_is_one_line(path, key, capsys):
    path.write_bytes(spoilt("kernel-ridge", lambda card, *others: card.pop(key)))
    assert cli.main(["card", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "not whole" in said


def test_texts_of_a_file_do_not_drive_the_terminal(path, capsys):
    path.write_bytes(spoilt("svm", put(0, "title", "nice\x1b[31m\r\ntitle [red]")))
    assert cli.main(["card", str(path)]) == 0
    said = capsys.readouterr().out
    assert "nice?[31m??title [red]" in said
    assert "\x1b" not in said
    path.write_bytes(spoilt("svm", put(0, "columns", [["[bold]\x1b]0;owned\x07", "um"]])))
    assert cli.main(["card", str(path)]) == 2
    assert "\x1b" not in capsys.readouterr().err


def say(line):
    """Hear nothing."""


def fitted(path, model="kernel-ridge", features="dimensionless", **options):
    targets = options.pop("targets", ("area", "force"))
    scaling = "l2" if features == "paper" else "standard"
    request = Request(path, path, targets, (model,), None, scaling, features, **options)
    return training.fit(request, Executor(), say)


@pytest.fixture(scope="module")
def ridge(solved):
    return fitted(solved)


class Evil:
    """Runs a command when a pickle of it is loaded."""

    def __reduce__(self):
        return os.system, ("touch evil",)


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "is no surrogate"),
        (b"PK", "fit it anew"),
        (b"heights 1 2 3", "is no surrogate"),
        (b"asperity surrogate\nformat 99\nsha256 " + b"0" * 64 + b"\n", "has format 99"),
        (b"asperity surrogate\nformat 7\nsha256 " + b"0" * 64 + b"\n", "is damaged"),
        (pickle.dumps(Evil()), "is no surrogate"),
    ],
)
def test_what_is_no_surrogate_is_refused_and_runs_nothing(tmp_path, monkeypatch, content, word):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "x.surrogate"
    path.write_bytes(content)
    with pytest.raises(InputError, match=rf"x\.surrogate.*{word}") as caught:
        Surrogate.load(path)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "evil").exists()


def test_distances_of_format_5_are_read(ridge, tmp_path):
    path = tmp_path / "x.surrogate"
    ridge.save(path)
    card, parts = crafted_surrogates.content(path.read_bytes())
    distance = parts["distance"]
    ((centre,), (whitening,)) = distance["centres"], distance["whitenings"]
    parts["distance"] = {"centre": centre, "whitening": whitening, "limit": distance["limit"]}
    for target in parts["targets"].values():
        del target["growth"]
    written = crafted_surrogates.written(card, parts).replace(b"format 7", b"format 5", 1)
    path.write_bytes(written)
    older = Surrogate.load(path)
    inputs = np.random.default_rng(0).normal(size=(5, centre.size))
    np.testing.assert_array_equal(older.distance.of(inputs), ridge.distance.of(inputs))
    assert all(each.calibration.growth is None for each in older.learnt.values())


def test_a_damaged_file_is_refused(ridge, tmp_path):
    path = tmp_path / "x.surrogate"
    ridge.save(path)
    whole = path.read_bytes()
    for size in (len(whole) // 2, len(whole) - 10):
        path.write_bytes(whole[:size])
        with pytest.raises(InputError, match="is damaged"):
            Surrogate.load(path)
    card, parts = crafted_surrogates.content(whole)
    parts["low"] = parts["low"][:3]
    path.write_bytes(crafted_surrogates.written(card, parts))
    with pytest.raises(InputError, match="is not whole"):
        Surrogate.load(path)


def test_an_old_file_stays_whole_until_the_new_one_is(ridge, tmp_path, monkeypatch):
    path = tmp_path / "x.surrogate"
    ridge.save(path)
    before = path.read_bytes()

    def fail(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(InputError, match="No space left"):
        ridge.save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
