"""Contact as a function: keyword arguments in, arrays out, for threads, processes and drivers."""

import inspect
import pickle
import warnings
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest
from databases import database_of
from learnt_rows import surrogate_of

import asperity
from asperity import functions
from asperity.functions import Unsolved
from gen.generation.sample import solve_contact, surface_numbered
from gen.runtime.errors import InputError
from gen.scene import Scene
from learn import Surrogate

SCENE = "samples = 60\n[surface]\nnodes = 17\n[store]\nmean_gap = true\n"
LOADS = {
    "delta": "[delta]\npieces = [{share = 1.0, range = [5.0, 20.0]}]\n",
    "pressure": '[load]\nquantity = "pressure"\nrange = [0.001, 0.1]\n',
    "load": '[load]\nquantity = "delta/height_rms"\nrange = [0.5, 2.0]\n',
}
ROUNDING = (
    1e-9  # of sums over many training rows, which depend on the rows that are predicted
)
POINT = {"hurst": 0.7, "sigma0": 12.0}


@pytest.fixture(scope="module")
def surrogate(tmp_path_factory):
    database = database_of(tmp_path_factory.mktemp("functions"), SCENE)
    return surrogate_of(database, "--target", "both", "--model", "kernel-ridge")


@pytest.fixture(scope="module")
def of_scene(tmp_path_factory):
    """A surrogate of the scene's own numbers."""
    database = database_of(tmp_path_factory.mktemp("means"), SCENE)
    return surrogate_of(database, "--target", "both", "--features", "scene")


OUTPUTS = ("delta", "area_percent", "stiffness", "hydraulic_aperture_x", "mean_gap")


@pytest.fixture(scope="module")
def solver():
    """The solver on the surfaces of the scene, with further outputs."""
    return asperity.SceneFunction(Scene.parse(SCENE, "s.toml"), OUTPUTS)


@pytest.fixture(scope="module")
def answer():
    """The outputs of a contact that is solved without a function."""
    scene = Scene.parse(SCENE, "s.toml").with_parameters(POINT, nodes=33)
    contact = solve_contact(scene, surface_numbered(scene, 3), 9.0)
    aperture = contact.flow().aperture
    area, stiffness = contact.area_percent, contact.stiffness
    return [contact.delta, area, stiffness, aperture, contact.mean_gap]


def test_the_inputs_of_the_solver_are_what_a_scene_draws(solver):
    assert solver.names == ("hurst", "sigma0", "delta")
    assert solver.outputs == OUTPUTS


def test_the_solver_answers_with_the_numbers_of_a_contact(solver, answer):
    assert solver(**POINT, delta=9.0, surface=3, nodes=33).tolist() == answer


def test_arrays_are_broadcast_to_the_shape_of_the_answer(solver, answer):
    question = {"hurst": [0.6, 0.7], "sigma0": 12.0, "delta": [[9.0], [3.0]]}
    many = solver(**question, surface=[0, 3], nodes=33)
    assert many.shape == (2, 2, 5)
    assert many[0, 1].tolist() == answer


def test_what_drivers_pass_along_changes_nothing():
    """As QUEENS does where a function takes further keywords, which it finds out in this way."""
    function = partial(asperity.SceneFunction("quick"), **POINT, nodes=9)
    assert inspect.getfullargspec(function).varkw
    passed = {
        "job_id": 7,
        "num_procs": 2,
        "experiment_dir": "here",
        "experiment_name": "first",
    }
    assert (
        function(delta=np.float64(9.0), **passed).tolist() == function(delta=9.0).tolist()
    )


@pytest.mark.parametrize(
    ("question", "words"),
    [
        ({"hurst": 0.7}, r"hurst given: the function takes hurst, sigma0, delta"),
        ({**POINT, "delta": -1.0}, r"delta = -1; allowed"),
        (
            {"hurst": [0.6, 0.7], "sigma0": 12.0, "delta": [1.0, 2.0, 3.0]},
            r"hurst \(2,\), delta \(3,\) do not belong together",
        ),
        (
            {"hurst": 0.7 + 0.1j, "sigma0": 12.0, "delta": 9.0},
            "hurst are of type complex128: real numbers",
        ),
        (
            {**POINT, "delta": 9.0, "surface": 1.5},
            r"surface = 1\.5: allowed: a whole number",
        ),
    ],
)
def test_wrong_questions_are_refused(question, words):
    with pytest.raises(InputError, match=words):
        asperity.SceneFunction("quick")(**question)


def test_a_scene_with_an_accuracy_is_solved_on_its_grid():
    text = """samples = 2
[surface]
generator = "spectral"
nodes = 64
side = 100.0
roll_off = 50.0
cut_off = 30.0
rms_slope = { choice = [0.1] }
[load]
quantity = "pressure"
range = 0.02
[contact]
boundary = "periodic"
[accuracy]
continuum_area = 0.1
"""
    area = asperity.SceneFunction(Scene.parse(text, "test"), ["continuum_area_percent"])
    answer = area(rms_slope=0.1, pressure=0.02)
    on_finer_grid = area(rms_slope=0.1, pressure=0.02, nodes=128)
    assert answer == pytest.approx(on_finer_grid, rel=0.1)
    assert area.scene.grid.shape < (64, 64)


def test_unknown_outputs_are_refused():
    words = r"colour: outputs are area_percent, force, delta, "
    with pytest.raises(InputError, match=words):
        asperity.SceneFunction("quick", ["colour"])


def test_contacts_without_a_solution_are_unsolved():
    beyond = SCENE + "[contact]\nboundary = 'periodic'\n"
    function = asperity.SceneFunction(Scene.parse(beyond, "s"))
    with pytest.raises(Unsolved, match="no equilibrium"):
        function(**POINT, delta=1e6)


def test_threads_and_processes_answer_alike(surrogate):
    deltas = np.linspace(4.0, 20.0, 8)
    learnt = asperity.SurrogateFunction(surrogate, outside="nan")
    for function in (asperity.SceneFunction("quick"), learnt):
        asked = partial(pickle.loads(pickle.dumps(function)), **POINT, nodes=17)
        with ThreadPoolExecutor(4) as threads:
            found = threads.map(lambda delta, ask=asked: ask(delta=delta), deltas)
            together = function(**POINT, delta=deltas, nodes=17)
            np.testing.assert_allclose(list(found), together, rtol=ROUNDING)


def differences(function, point, name, step=1e-6):
    """Return central differences of a function by one of its inputs, (outputs,)."""
    above = function(**{**point, name: point[name] * (1 + step)})
    below = function(**{**point, name: point[name] * (1 - step)})
    return (above - below) / (2 * step * point[name])


SPECTRAL = """samples = 4
[surface]
generator = "spectral"
nodes = 33
roll_off = 500
cut_off = 125
rms_height = [1, 3]
"""
TIGHT = "[contact]\nrtol = 1e-12\n"
SURFACES = {
    "hurst and sigma0": SCENE + TIGHT,
    "spectral": SPECTRAL + TIGHT,
    "spectral, two bodies": SPECTRAL + "against = 'another'\n" + TIGHT,
    "yielding": SPECTRAL + TIGHT + "hardness = 0.02\n",
    "periodic": SPECTRAL + TIGHT + "boundary = 'periodic'\n",
}


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("surface", SURFACES)
def test_the_solvers_gradient_is_that_of_differences(surface, load):
    scene = Scene.parse(SURFACES[surface] + LOADS[load], "s")
    function = asperity.SceneFunction(scene, ["force", "delta", "mean_gap"])
    point = {"delta": 2.5, "pressure": 0.003, "load": 0.8}
    point = {load: point[load], "rms_height": 2.0}
    if "sigma0" in function.names:
        point = {load: point[load], **POINT}
    gradient = function.gradient(**point)
    for column, name in enumerate(function.names):
        if name == "hurst":
            assert np.isnan(gradient[:, column]).all()
            continue
        expected = differences(function, point, name)
        np.testing.assert_allclose(gradient[:, column], expected, rtol=1e-4, atol=1e-6)


def test_a_surrogate_is_the_same_function(surrogate):
    function = asperity.SurrogateFunction(surrogate)
    assert function.names == ("hurst", "sigma0", "delta")
    assert function.outputs == ("area", "force")
    scene = Scene.parse(SCENE, "s")
    heights = surface_numbered(scene.with_parameters(POINT), 2)
    wanted = Surrogate.load(surrogate).predict(heights, scene.sides, 9.0)
    found = function(**POINT, delta=9.0, surface=2)
    assert found.tolist() == [wanted.area[0], wanted.force[0]]


def test_a_surrogate_has_a_gradient(surrogate):
    function = asperity.SurrogateFunction(surrogate)
    gradient = function.gradient(**POINT, delta=9.0, surface=2)
    assert gradient.shape == (2, 3)
    less, more = (function(**POINT, delta=at, surface=2) for at in (9.0, 9.1))
    np.testing.assert_allclose(gradient[:, 2], (more - less) / 0.1, rtol=0.1)


def counted(monkeypatch, owner, name):
    """Count the calls of a function or method: one entry a call."""
    calls, unchanged = [], getattr(owner, name)

    def counting(*arguments, **options):
        calls.append(name)
        return unchanged(*arguments, **options)

    monkeypatch.setattr(owner, name, counting)
    return calls


def test_points_share_their_surfaces_and_a_surrogate_predicts_them_together(
    surrogate, monkeypatch
):
    made = counted(monkeypatch, functions, "surface_numbered")
    predicted = counted(monkeypatch, Surrogate, "predict_rows")
    deltas = np.linspace(6.0, 18.0, 5)[:, None]
    question = {"hurst": [0.7, 0.65], "sigma0": 12.0, "delta": deltas, "surface": [3, 3]}
    for function in (
        asperity.SceneFunction(Scene.parse(SCENE, "s")),
        asperity.SurrogateFunction(surrogate, outside="nan"),
    ):
        many = function(**question)
        assert len(made) == 2
        one = function(hurst=0.65, sigma0=12.0, delta=deltas[3, 0], surface=3)
        np.testing.assert_allclose(many[3, 1], one, rtol=ROUNDING)
        made.clear()
    assert len(predicted) == 2


def test_a_surrogate_of_a_scene_answers_all_points_by_one_prediction(
    of_scene, monkeypatch
):
    deltas = np.linspace(6.0, 18.0, 1000)
    wanted = Surrogate.load(of_scene).predict(**POINT, delta=deltas)
    predicted = counted(monkeypatch, Surrogate, "predict_rows")
    found = asperity.SurrogateFunction(of_scene)(**POINT, delta=deltas)
    np.testing.assert_array_equal(found, np.stack([wanted.area, wanted.force], axis=-1))
    assert len(predicted) == 1


ALL_KINDS = ["inside", "area", "area_low", "force_high", "area_mean", "area_mean_high"]
"""Outputs of all kinds of a surrogate of a scene's own numbers."""


def test_flag_interval_and_mean_are_outputs_of_a_surrogate(of_scene):
    function = asperity.SurrogateFunction(of_scene, ALL_KINDS, outside="nan", level=0.8)
    copy = pickle.loads(pickle.dumps(function))
    surrogate = Surrogate.load(of_scene)
    usual, mean = (
        surrogate.predict(**POINT, delta=9.0, level=0.8, mean=m) for m in (False, True)
    )
    wanted = [1, usual.area[0], usual.low["area"][0], usual.high["force"][0]]
    wanted += [usual.area[0], mean.high["area"][0]]
    assert copy(**POINT, delta=9.0).tolist() == wanted


def test_the_flag_alone_has_no_gradient(of_scene):
    function = asperity.SurrogateFunction(of_scene, ALL_KINDS, outside="nan", level=0.8)
    unknown = np.isnan(function.gradient(**POINT, delta=9.0)).all(axis=1)
    assert unknown.tolist() == [True, *[False] * 5]


def test_outputs_that_a_surrogate_lacks_are_refused(of_scene):
    words = "area_mode: outputs are area, force, inside, area_low"
    with pytest.raises(InputError, match=words):
        asperity.SurrogateFunction(of_scene, ["area_mode"])


FAR = [9.0, 1e5]
"""A Delta inside the training of the surrogate, and one outside."""


def test_no_interval_holds_outside_the_training_and_a_warning_tells(surrogate):
    function = asperity.SurrogateFunction(surrogate, ["area", "area_low", "inside"])
    words = r"1 of 2 points lie outside what .* delta/h"
    with pytest.warns(asperity.OutsideTraining, match=words):
        (_, low, inside), (value, outer_low, outside) = function(**POINT, delta=FAR)
    assert (inside, outside) == (1, 0)
    assert np.isfinite([low, value]).all()
    assert np.isnan(outer_low)


def test_the_first_call_outside_the_training_warns_alone(surrogate):
    function = asperity.SurrogateFunction(surrogate, ["area", "area_low"])
    with pytest.warns(asperity.OutsideTraining):
        function(**POINT, delta=FAR)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        function(**POINT, delta=FAR)


def test_ends_of_intervals_have_no_gradient_outside_the_training(surrogate):
    function = asperity.SurrogateFunction(surrogate, ["area", "area_low"])
    with pytest.warns(asperity.OutsideTraining):
        gradient = function.gradient(**POINT, delta=1e5)
    assert np.isnan(gradient[1]).all()


def test_a_surrogate_may_withhold_predictions_outside_the_training(surrogate):
    function = asperity.SurrogateFunction(surrogate, ["area", "inside"], outside="nan")
    withheld = np.isnan(function(**POINT, delta=FAR))
    assert withheld.tolist() == [[False, False], [True, False]]


def test_a_surrogate_may_refuse_points_outside_the_training(surrogate):
    function = asperity.SurrogateFunction(surrogate, ["area", "inside"], outside="raise")
    with pytest.raises(InputError, match=r"1 of 2 points lie outside .* outside 0\."):
        function(**POINT, delta=FAR)


def test_an_unknown_way_with_points_outside_the_training_is_refused(surrogate):
    with pytest.raises(InputError, match="outside = 'ignore': allowed: warn, nan, raise"):
        asperity.SurrogateFunction(surrogate, outside="ignore")


def test_a_hardness_of_each_point_is_that_of_its_prediction(tmp_path_factory):
    hard = "[contact]\nhardness = [0.01, 0.1]\n"
    database = database_of(tmp_path_factory.mktemp("hardness"), SCENE + hard)
    path = surrogate_of(database, "--target", "area", "--model", "kernel-ridge")
    function = asperity.SurrogateFunction(path, outside="nan")
    assert function.names == ("hurst", "sigma0", "delta", "hardness")
    many = function(**POINT, delta=9.0, hardness=[0.02, 0.05])
    one = [function(**POINT, delta=9.0, hardness=each) for each in (0.02, 0.05)]
    np.testing.assert_allclose(many, one, rtol=ROUNDING)
    assert many[0] != many[1]


@pytest.mark.parametrize("contact", ["hardness = [0.01, 0.1]", "modulus = 2.0"])
def test_a_surrogate_of_a_scenes_numbers_takes_each_number_by_its_name(
    contact, tmp_path_factory
):
    """Its features name a hardness before the load, its arguments the load before a hardness."""
    text = f"{SCENE}[contact]\n{contact}\n"
    database = database_of(tmp_path_factory.mktemp("numbers"), text)
    path = surrogate_of(database, "--target", "area", "--features", "scene")
    function = asperity.SurrogateFunction(path, ["area", "inside"])
    numbers = {**POINT, "delta": 9.0}
    if "hardness" in function.names:
        assert function.names == ("hurst", "sigma0", "delta", "hardness")
        numbers["hardness"] = 0.05
    surrogate = Surrogate.load(path)
    wanted = surrogate.predict_rows(surrogate.of_numbers(numbers)).values["area"]
    area, inside = function(**numbers)
    assert area == pytest.approx(wanted[0], rel=ROUNDING)
    assert inside == 1
