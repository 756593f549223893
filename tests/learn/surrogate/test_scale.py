"""Targets of a user's own keep their dimension, and those without one hold at their own scale."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
import user_functions

import bem
from gen import cli
from gen.quantities import QUANTITIES
from gen.surface import generate
from learn import cli as learn_cli
from learn.surrogate import Surrogate, learnt

SCENE = """samples = 120
[surface]
nodes = 33
[contact]
modulus = 2.0
[store]
mean_gap = true
function = "mine:outputs"
least = { my_force = 0.0, my_gap = 0.0 }
"""
MODULE = """
def outputs(contact):
    return {
        "my_force": (contact.force, "uN"),
        "my_gap": (contact.mean_gap, "um"),
        "my_offset": (contact.mean_gap + 3.0, "um"),
    }
"""
TARGETS = "force,mean_gap,my_force,my_gap"
SIDE, DELTA, MODULUS = 1000.0, np.array([6.0, 12.0, 20.0]), 2.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a database whose function returns copies of the force and the mean gap."""
    made = tmp_path_factory.mktemp("own")
    with pytest.MonkeyPatch.context() as patch, user_functions.inside(made, patch, ""):
        (made / "mine.py").write_text(MODULE)
        (made / "scene.toml").write_text(SCENE)
        assert cli.main(["run", "scene.toml", "-o", "own.h5"]) == 0
    return made


def fitted(folder, targets, *options):
    """Fit a surrogate to the database, and return its file."""
    path = folder / f"{targets}{''.join(options)}.surrogate"
    arguments = [
        "fit",
        str(folder / "own.h5"),
        "--model",
        "kernel-ridge",
        "--target",
        targets,
    ]
    assert learn_cli.main([*arguments, *options, "-o", str(path)]) == 0
    return path


@pytest.fixture(scope="module", params=["dimensionless", "hybrid"])
def surrogate(folder, request):
    return Surrogate.load(fitted(folder, TARGETS, "--features", request.param))


def surface(seed=7):
    return generate("diamond-square", 33, 0.7, 12.0, np.random.default_rng(seed))


CHANGES = {
    "heights": (2.0, 1.0, 1.0),
    "lengths": (1.0, 2.0, 1.0),
    "modulus": (1.0, 1.0, 1000.0),
}


@pytest.mark.few(3)
@pytest.mark.parametrize("change", CHANGES)
def test_copies_of_quantities_scale_as_the_quantities_do(surrogate, change):
    up, longer, stiffer = CHANGES[change]
    before = surrogate.predict(surface(), SIDE, DELTA)
    e_star = stiffer * MODULUS
    after = surrogate.predict(up * surface(), longer * SIDE, up * DELTA, e_star=e_star)
    for name, original in (("my_force", "force"), ("my_gap", "mean_gap")):
        powers = QUANTITIES[original].powers
        grown = up**powers.heights * longer**powers.lengths * stiffer**powers.modulus
        np.testing.assert_allclose(
            after.values[name], grown * before.values[name], rtol=1e-6
        )
        np.testing.assert_allclose(after.values[name], after.values[original], rtol=1e-9)
        np.testing.assert_allclose(after.high[name], after.high[original], rtol=1e-9)
    assert after.reasons == before.reasons


def test_copies_of_quantities_are_learnt_as_well_as_these(surrogate):
    scores = {
        name: target["scores"]["nmae"]
        for name, target in surrogate.card["targets"].items()
    }
    assert scores["my_force"] == pytest.approx(scores["force"], rel=1e-9)
    assert scores["my_gap"] == pytest.approx(scores["mean_gap"], rel=1e-9)


@pytest.fixture(scope="module")
def bound(folder):
    """A surrogate one of whose targets scales with no powers."""
    return fitted(folder, "force,my_offset", "--features", "hybrid")


def test_the_fit_says_that_a_target_holds_at_its_own_scale_alone(folder, capsys):
    fitted(folder, "my_offset", "--features", "dimensionless")
    assert (
        "my_offset: has no known powers of heights, lengths and E*"
        in capsys.readouterr().err
    )


def test_a_target_without_powers_holds_at_its_own_scale(bound):
    surrogate = Surrogate.load(bound)
    own = surrogate.predict(surface(), SIDE, DELTA)
    assert not any("the only scale of my_offset" in reason for reason in own.reasons)


@pytest.mark.parametrize(
    ("up", "longer", "e_star", "fault"),
    [
        (100.0, 1.0, None, "rms height"),
        (1.0, 2.0, None, "scan length L 2000 um outside 1000 to 1000"),
        (1.0, 1.0, 3.0, "E* 3 MPa outside 2 to 2"),
    ],
)
def test_a_target_without_powers_flags_every_other_scale(
    bound, up, longer, e_star, fault
):
    surrogate = Surrogate.load(bound)
    other = surrogate.predict(up * surface(), longer * SIDE, up * DELTA, e_star=e_star)
    assert all(fault in reason for reason in other.reasons)
    assert all("the only scale of my_offset" in reason for reason in other.reasons)


def test_databases_without_powers_are_learnt_at_their_own_scale(folder, tmp_path):
    with (
        h5py.File(folder / "own.h5") as file,
        h5py.File(tmp_path / "own.h5", "w") as copy,
    ):
        for name in file:
            file.copy(name, copy)
        for name, value in file.attrs.items():
            copy.attrs[name] = value
        content = json.loads(file.attrs["scene"])
        del content["store"]["powers"]
        text = json.dumps(content, sort_keys=True).encode()
        copy.attrs.create("scene", text, dtype=h5py.string_dtype("utf-8", len(text)))
    surrogate = Surrogate.load(
        fitted(tmp_path, "my_force", "--features", "dimensionless")
    )
    assert surrogate.learnt["my_force"].powers is None
    assert not surrogate.predict(surface(), 2 * SIDE, DELTA).inside.any()


@pytest.fixture
def of_before(folder, tmp_path, monkeypatch):
    """A surrogate of the format before, with a target of a user's own and one of contacts."""
    surrogate = Surrogate.load(
        fitted(folder, "force,my_offset", "--features", "dimensionless")
    )
    packed = learnt._packed

    def without_powers(target):
        return {name: value for name, value in packed(target).items() if name != "powers"}

    card = {name: value for name, value in surrogate.card.items() if name != "own_scale"}
    monkeypatch.setattr(learnt, "_packed", without_powers)
    monkeypatch.setattr(learnt, "FORMAT", learnt.WITHOUT_POWERS)
    replace(surrogate, card=card).save(tmp_path / "before.surrogate")
    monkeypatch.undo()
    return tmp_path / "before.surrogate"


def test_files_of_before_are_read_and_keep_to_their_own_scale(of_before):
    surrogate = Surrogate.load(of_before)
    assert surrogate.learnt["force"].powers == (1, 1, 1)
    assert surrogate.learnt["my_offset"].powers is None
    own = surrogate.predict(surface(), SIDE, DELTA)
    assert not any("my_offset" in reason for reason in own.reasons)
    for up, longer, e_star in ((100.0, 1.0, None), (1.0, 2.0, None), (1.0, 1.0, 3.0)):
        other = surrogate.predict(
            up * surface(), longer * SIDE, up * DELTA, e_star=e_star
        )
        assert all("the only scale of my_offset" in reason for reason in other.reasons)


def test_quantities_of_contacts_need_no_scale_of_their_own(surrogate):
    assert "own_scale" not in surrogate.card
    contact = bem.solve(surface(), SIDE, 12.0, modulus=MODULUS)
    predicted = surrogate.predict(surface(), SIDE, 12.0).values["my_force"][0]
    assert predicted == pytest.approx(contact.force, rel=0.3)
