"""Surrogates' files from anywhere: damaged or hostile ones are refused, and run nothing."""

import io
import json
import sys
import zipfile
from contextlib import suppress

import numpy as np
import pytest
import skops.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from skops.io._audit import NODE_TYPE_MAPPING

from gen.errors import InputError
from gen.farm import World
from gen.surface import generate
from learn import Surrogate, cli
from learn.request import Request
from learn.surrogate import storage, training

LOADERS = sorted(NODE_TYPE_MAPPING)
if isinstance(LOADERS[0], tuple):
    LOADERS = sorted({name for name, _ in LOADERS})
MANY = settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])


def say(line):
    """Hear nothing."""


@pytest.fixture(scope="module")
def path(solved, tmp_path_factory):
    return tmp_path_factory.mktemp("files") / "x.surrogate"


@pytest.fixture(scope="module")
def whole(solved, path):
    """The bytes of a good file."""
    request = Request(
        solved, solved, ("area",), ("kernel-ridge",), None, "standard", "dimensionless"
    )
    training.fit(request, World(), say).save(path)
    return path.read_bytes()


@pytest.fixture(scope="module")
def parts(whole):
    with zipfile.ZipFile(io.BytesIO(whole)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.fixture(scope="module")
def heights():
    return generate("diamond-square", 33, 0.7, 12.0, np.random.default_rng(5))


@pytest.fixture(scope="module")
def area(whole, path, heights):
    path.write_bytes(whole)
    return Surrogate.load(path).predict(heights, 1000.0, [5.0, 20.0]).area


@pytest.fixture
def landmine(tmp_path, monkeypatch):
    """A module that leaves a trace when it is imported, and what it offers when it is called."""
    trace = tmp_path / "trace"
    lines = (
        "from pathlib import Path",
        f"Path({str(trace)!r}).touch()",
        "class Landmine:",
        f"    def __new__(cls, *a, **k): Path({str(trace)!r}).touch()",
        f"    def __init_subclass__(cls): Path({str(trace)!r}).touch()",
    )
    (tmp_path / "landmine.py").write_text("\n".join(lines) + "\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield trace
    sys.modules.pop("landmine", None)


def zipped(parts):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def nodes(schema):
    """Every part of a schema that names a type."""
    if isinstance(schema, dict):
        if "__class__" in schema:
            yield schema
        for each in schema.values():
            yield from nodes(each)
    elif isinstance(schema, list):
        for each in schema:
            yield from nodes(each)


def refused_or_the_same(path, content, heights, area):
    path.write_bytes(content)
    try:
        found = Surrogate.load(path).predict(heights, 1000.0, [5.0, 20.0]).area
    except InputError as error:
        said = str(error)
        assert said.startswith(str(path))
        assert said.isprintable(), "one line, and nothing that drives a terminal"
    else:
        np.testing.assert_array_equal(found, area)


@MANY
@given(data=st.data())
def test_flipped_bytes(path, whole, heights, area, data):
    content = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(whole) - 1))] ^= data.draw(st.integers(1, 255))
    refused_or_the_same(path, bytes(content), heights, area)


@MANY
@given(size=st.floats(0, 0.9999), more=st.binary(max_size=40))
def test_files_cut_off_or_followed_by_something(path, whole, heights, area, size, more):
    cut = whole[: int(size * len(whole))]
    path.write_bytes(cut + more)
    with pytest.raises(InputError, match=r"x\.surrogate"):
        Surrogate.load(path)
    refused_or_the_same(path, whole + more, heights, area)


@MANY
@given(data=st.data())
def test_schemas_with_other_values(path, parts, heights, area, data):
    schema = json.loads(parts["schema.json"])
    node = data.draw(st.sampled_from(list(nodes(schema))))
    key = data.draw(st.sampled_from(sorted(node)))
    node[key] = data.draw(st.sampled_from([None, "", "x", -1, [], {}, [[]], {"a": 1}, 1e300]))
    path.write_bytes(zipped({**parts, "schema.json": json.dumps(schema).encode()}))
    with suppress(InputError):
        Surrogate.load(path).predict(heights, 1000.0, [5.0, 20.0])


@pytest.mark.parametrize("loader", [None, *LOADERS])
def test_types_off_the_list_are_neither_imported_nor_run(path, parts, heights, landmine, loader):
    schema = json.loads(parts["schema.json"])
    places = len(list(nodes(schema)))
    for place in np.random.default_rng(len(loader or "")).integers(places, size=3):
        schema = json.loads(parts["schema.json"])
        node = list(nodes(schema))[place]
        node["__module__"], node["__class__"] = "landmine", "Landmine"
        node["__loader__"] = loader or node["__loader__"]
        path.write_bytes(zipped({**parts, "schema.json": json.dumps(schema).encode()}))
        with suppress(InputError):  # plain values ignore what type a file names for them
            Surrogate.load(path).predict(heights, 1000.0, [5.0])
        assert not landmine.exists()
        assert "landmine" not in sys.modules


@pytest.mark.parametrize(
    "named",
    [
        ("os", "system"),
        ("builtins", "eval"),
        ("pickle", "loads"),
        ("subprocess", "Popen"),
        ("functools", "partial"),
        ("types", "CodeType"),
        ("numpy", "load"),
        ("joblib", "load"),
    ],
)
def test_callables_that_run_code_are_refused_by_name(path, parts, named):
    schema = json.loads(parts["schema.json"])
    estimator = next(each for each in nodes(schema) if each["__class__"] == "SafeKernelRidge")
    estimator["__module__"], estimator["__class__"] = named
    path.write_bytes(zipped({**parts, "schema.json": json.dumps(schema).encode()}))
    with pytest.raises(InputError, match=rf"holds {'.'.join(named)}, which no surrogate needs"):
        Surrogate.load(path)


@pytest.mark.parametrize("key", ["title", "rows", "targets", "versions", "columns", "delta"])
def test_a_card_that_lacks_something_is_one_line(path, whole, key, capsys):
    content = skops.io.loads(whole, trusted=list(storage.REVIEWED))
    del content["card"][key]
    storage.save(path, {name: value for name, value in content.items() if name != "format"})
    assert cli.main(["card", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "not whole" in said


def test_texts_of_a_file_do_not_drive_the_terminal(path, whole, capsys):
    content = skops.io.loads(whole, trusted=list(storage.REVIEWED))
    content["card"]["title"] = "nice\x1b[31m\r\ntitle [red]"
    content["card"]["columns"][0] = ["[bold]\x1b]0;owned\x07", "um"]
    storage.save(path, content)
    assert cli.main(["card", str(path)]) == 0
    said = capsys.readouterr().out
    assert "nice?[31m??title [red]" in said
    assert "\x1b" not in said
