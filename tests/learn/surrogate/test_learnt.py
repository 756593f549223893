"""What is learnt of a target; its file: what is kept, and strangers' files, of which no code runs.

Moments beyond those of the training are taken for the nearest ones; other features are not.
"""

import hashlib
import json
import os
import pickle
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from databases import run
from learnt_rows import fitted
from skops import io

from gen.runtime.errors import InputError
from learn import Surrogate, cli
from learn.features.rows import Rows
from learn.models import MODELS, pipeline
from learn.surrogate.learnt import FORMAT, HEAD


@pytest.fixture(scope="module")
def ridge(solved):
    return fitted(solved, targets=("area",))


@pytest.fixture
def path(ridge, tmp_path):
    """A whole file, which a test may change."""
    ridge.save(tmp_path / "x.surrogate")
    return tmp_path / "x.surrogate"


def content(path):
    """The card with the ranges, and the models, of a file."""
    data = path.read_bytes()
    body = data[HEAD.match(data).end() :]
    end = 8 + int.from_bytes(body[:8], "little")
    return json.loads(body[8:end]), body[end:]


def unpacked(path):
    """The card with the ranges, and the models as objects, which a test may change."""
    card, models = content(path)
    return card, io.loads(models, trusted=io.get_untrusted_types(data=models))


def written(path, card, models, number=FORMAT):
    """Write a file with a right checksum, whatever it holds."""
    text = card if isinstance(card, bytes) else json.dumps(card).encode()
    body = len(text).to_bytes(8, "little") + text + models
    digest = hashlib.sha256(body).hexdigest()
    path.write_bytes(
        f"asperity surrogate\nformat {number}\nsha256 {digest}\n".encode() + body
    )


SETTINGS = [
    ("random-forest", {"n_estimators": 5}, "l2"),
    ("xgboost", {"n_estimators": 20, "max_depth": 12, "gamma": 1.0}, "min-max"),
    ("gradient-boost", {"n_estimators": 5}, "none"),
    ("gaussian-process", {"alpha": 1e-5}, "l2"),
    ("mlp", {"solver": "adam", "max_iter": 5}, "min-max"),
    ("mlp", {"solver": "sgd", "learning_rate": "adaptive", "max_iter": 5}, "none"),
    ("svm", {"kernel": "poly", "degree": 2}, "l2"),
]


@pytest.mark.parametrize(("model", "settings", "normalisation"), SETTINGS)
def test_settings_of_searches_are_kept(ridge, tmp_path, model, settings, normalisation):
    """Of all solvers, kernels and scalings that `learn tune` may find."""
    random = np.random.default_rng(0)
    inputs = random.uniform(ridge.low, ridge.high, (40, ridge.low.size))
    made = pipeline(MODELS[model], settings, normalisation=normalisation, tuned=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        made.set_params(model__max_iter=5) if model == "mlp" else None
        made.fit(inputs, random.normal(size=40))
    area = replace(ridge.learnt["area"], pipeline=made)
    other = replace(ridge, card={**ridge.card, "model": model}, learnt={"area": area})
    other.save(tmp_path / "x.surrogate")
    loaded = Surrogate.load(tmp_path / "x.surrogate").learnt["area"]
    np.testing.assert_array_equal(loaded.raw(inputs), area.raw(inputs))


def test_a_gaussian_process_is_kept_without_the_square_of_its_rows(ridge, tmp_path):
    random = np.random.default_rng(0)
    inputs = random.uniform(ridge.low, ridge.high, (400, ridge.low.size))
    process = pipeline(
        MODELS["gaussian-process"], {"alpha": 1e-5}, normalisation="standard"
    )
    process.fit(inputs, inputs[:, 0])
    area = replace(ridge.learnt["area"], pipeline=process)
    other = replace(
        ridge, card={**ridge.card, "model": "gaussian-process"}, learnt={"area": area}
    )
    other.save(tmp_path / "x.surrogate")
    assert (tmp_path / "x.surrogate").stat().st_size < 400 * 400 * 8 / 4
    assert process.named_steps["model"].L_ is not None, "the fitted one keeps its own"
    loaded = Surrogate.load(tmp_path / "x.surrogate").learnt["area"]
    np.testing.assert_allclose(loaded.raw(inputs), area.raw(inputs), rtol=1e-6, atol=1e-9)


def test_models_of_types_that_nobody_reviewed_are_not_written(ridge, tmp_path):
    from sklearn.gaussian_process.kernels import Matern

    process = pipeline(
        MODELS["gaussian-process"], {"kernel": Matern()}, normalisation="none"
    )
    process.fit(np.eye(2, ridge.low.size), np.arange(2.0))
    area = replace(ridge.learnt["area"], pipeline=process)
    with pytest.raises(ValueError, match="Matern are not kept"):
        replace(ridge, learnt={"area": area}).save(tmp_path / "y.surrogate")
    assert not list(tmp_path.iterdir())


class Evil:
    """Runs a command when a pickle of it is loaded."""

    def __reduce__(self):
        return os.system, ("touch evil",)


def test_loading_imports_and_runs_nothing_that_a_file_names(path, tmp_path, monkeypatch):
    module = tmp_path / "landmine.py"
    module.write_text(
        "class Landmine:\n    def __setstate__(self, state):\n        pass\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    import landmine

    card, whole = unpacked(path)
    whole["targets"]["area"]["pipeline"].steps[-1] = ("model", landmine.Landmine())
    crafted = io.dumps(whole)
    del sys.modules["landmine"]
    module.write_text("from pathlib import Path\nPath('trace').touch()\n")
    written(path, card, crafted)
    with pytest.raises(InputError, match=r"x\.surrogate: its models.*landmine\.Landmine"):
        Surrogate.load(path)
    assert "landmine" not in sys.modules
    assert not (tmp_path / "trace").exists()


@pytest.mark.parametrize("called", [os.system, eval])
def test_functions_are_no_part_of_a_model(path, called):
    card, whole = unpacked(path)
    whole["targets"]["area"]["pipeline"].named_steps["model"].kernel = called
    written(path, card, io.dumps(whole))
    with pytest.raises(InputError, match=r"x\.surrogate: its models cannot be used here"):
        Surrogate.load(path)


def test_damage_is_always_seen(path):
    whole = path.read_bytes()
    random = np.random.default_rng(1)
    for place in random.integers(len(whole), size=40):
        spoilt = bytearray(whole)
        if place % 2:
            spoilt[place] ^= int(random.integers(1, 256))
        else:
            del spoilt[place:]
        path.write_bytes(bytes(spoilt))
        with pytest.raises(InputError, match=r"x\.surrogate") as caught:
            Surrogate.load(path)
        assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("whole", "word"),
    [
        (b"", "is no surrogate"),
        (b"PK", "is no surrogate"),
        (b"heights 1 2 3", "is no surrogate"),
        (b"asperity surrogate\nformat 99\nsha256 " + b"0" * 64 + b"\n", "has format 99"),
        (b"asperity surrogate\nformat 9\nsha256 " + b"0" * 64 + b"\n", "is damaged"),
        (pickle.dumps(Evil()), "is no surrogate"),
    ],
)
def test_what_is_no_surrogate_is_refused_and_runs_nothing(
    tmp_path, monkeypatch, whole, word
):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "x.surrogate"
    path.write_bytes(whole)
    with pytest.raises(InputError, match=rf"x\.surrogate.*{word}") as caught:
        Surrogate.load(path)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "evil").exists()


@pytest.mark.parametrize("text", [b"[" * 80_000, b"\xff", b"{}"])
def test_cards_that_are_none_are_refused(path, text):
    written(path, text, b"")
    with pytest.raises(
        InputError, match=r"x\.surrogate: is no surrogate that could be read"
    ):
        Surrogate.load(path)


def other_type(models):
    models["targets"]["area"]["pipeline"].steps[-1] = (
        "model",
        MODELS["svm"].estimator(0),
    )


def other_version(models):
    del vars(models["targets"]["area"]["pipeline"].named_steps["model"])["dual_coef_"]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda models: models["targets"].pop("area"), "area"),
        (lambda models: models["targets"]["area"].pop("scaling"), "scaling"),
        (other_type, "SVR"),
        (other_version, "dual_coef_"),
    ],
)
def test_models_that_the_libraries_here_cannot_use_are_one_line(
    path, refused, change, word
):
    """It names what made them, and the command that fits anew."""
    card, whole = unpacked(path)
    change(whole)
    card["card"]["versions"]["scikit-learn"] = "1.0"
    written(path, card, io.dumps(whole))
    for command in (["predict", "-", "--delta", "5"], ["law", "quick", "--csv", "x.csv"]):
        said = refused(cli, command[0], path, *command[1:])
        assert word in said
        assert "scikit-learn 1.0" in said
        assert "--model kernel-ridge --features dimensionless" in said


def test_older_files_are_refused_with_the_command_that_fits_anew(path, ridge):
    old = Path(__file__).with_name("rooted.surrogate")  # of format 4
    with pytest.raises(
        InputError, match=r"has format 4, this version reads 10: fit it anew: "
    ):
        Surrogate.load(old)
    card = {
        **ridge.card,
        "database": "my rows.h5",
        "features": "hybrid",
        "blocks": 65,
        "area_max": 16.56,
        "seed": 3,
        "normalisation": "l2",
        "targets": {"area": {"settings_from": "tuned in found/area"}, "force": {}},
        "calibration": {"database": "other.h5"},
    }
    written(path, {"card": card, "parts": {}, "arrays": []}, b"", number=7)
    with pytest.raises(InputError) as caught:
        Surrogate.load(path)
    assert str(caught.value).endswith(
        "learn fit 'my rows.h5' --model kernel-ridge --features hybrid --target area,force --seed"
        " 3 --blocks 65 --area-max 16.56 --normalise l2 --calibrate-on other.h5 --from found -o"
        f" {path}"
    )


def test_the_command_that_fits_anew_names_the_comparison_of_the_card(path, ridge):
    area = {"settings_from": "in other words", "comparison": "found/area"}
    card = {**ridge.card, "targets": {"area": area}}
    written(path, {"card": card, "parts": {}, "arrays": []}, b"", number=7)
    with pytest.raises(InputError, match=" --from found -o "):
        Surrogate.load(path)


@pytest.mark.parametrize("key", ["rows", "targets"])
def test_a_card_that_lacks_something_is_one_line(path, key, refused):
    card, models = content(path)
    del card["card"][key]
    written(path, card, models)
    assert "not whole" in refused(cli, "card", path)


def test_texts_of_a_file_do_not_drive_the_terminal(path, capsys):
    card, models = content(path)
    card["card"]["title"] = "nice\x1b[31m\r\ntitle [red]"
    card["card"]["columns"][0] = ["[bold]\x1b]0;owned\x07", "um"]
    written(path, card, models)
    assert cli.main(["card", str(path)]) == 0
    said = capsys.readouterr().out
    assert "nice?[31m??title [red]" in said
    assert "\x1b" not in said


def test_a_card_is_read_without_the_libraries_of_models(path):
    script = """
        import sys
        from learn import cli
        assert cli.main(["card", sys.argv[1]]) == 0
        print({"skops", "sklearn", "xgboost"} & sys.modules.keys(), file=sys.stderr)
    """
    assert run(script, path).stderr == "set()\n"


@pytest.fixture(scope="module")
def surrogate(solved):
    return fitted(solved, features="hybrid", targets=("area",))


@pytest.fixture
def middle(surrogate):
    return (surrogate.low + surrogate.high) / 2


def test_a_moment_beyond_the_training_is_that_at_the_end_of_its_range(surrogate, middle):
    name, times = "peak_kurtosis_pearson", 40.0
    place = surrogate.features.columns.index(name)
    end, beyond, further = middle.copy(), middle.copy(), middle.copy()
    span = surrogate.high[place] - surrogate.low[place]
    end[place] = surrogate.high[place]
    beyond[place] = surrogate.high[place] + times * span
    further[place] = surrogate.low[place] - times * span
    inputs = np.array([end, beyond, further, middle])
    found, rows = (
        surrogate.learnt["area"].raw(inputs),
        Rows(np.empty((4, 0)), np.ones(4), 1.0),
    )
    assert found[0] == found[1]
    assert found[2] != found[3], "the other end is another place"
    reasons = surrogate.training.reasons(rows, inputs)
    assert [name in reason for reason in reasons] == [False, True, True, False]
