"""Contact as a function: keyword arguments in, arrays out, for threads, processes and drivers."""

import inspect
import pickle
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest
from databases import database_of
from learnt_rows import surrogate_of

import asperity
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
POINT = {"hurst": 0.7, "sigma0": 12.0}


@pytest.fixture(scope="module")
def surrogate(tmp_path_factory):
    database = database_of(tmp_path_factory.mktemp("functions"), SCENE)
    return surrogate_of(database, "--target", "both", "--model", "kernel-ridge")


def test_the_solver_is_a_function_of_what_a_scene_draws():
    scene = Scene.parse(SCENE, "s.toml")
    outputs = "delta", "area_percent", "stiffness", "hydraulic_aperture_x", "mean_gap"
    function = asperity.SceneFunction(scene, outputs)
    assert (function.names, function.outputs) == (("hurst", "sigma0", "delta"), outputs)
    found = function(**POINT, delta=9.0, surface=3, nodes=33)
    asked = scene.with_parameters(POINT, nodes=33)
    contact = solve_contact(asked, surface_numbered(asked, 3), 9.0)
    aperture = contact.flow().aperture
    of = contact.delta, contact.area_percent, contact.stiffness, aperture, contact.mean_gap
    assert found.tolist() == list(of)
    many = function(hurst=[0.6, 0.7], sigma0=12.0, delta=[[9.0], [3.0]], surface=[0, 3], nodes=33)
    assert many.shape == (2, 2, 5)
    assert many[0, 1].tolist() == list(of)


def test_what_drivers_pass_along_changes_nothing():
    """As QUEENS does where a function takes further keywords, which it finds out in this way."""
    function = partial(asperity.SceneFunction("quick"), **POINT, nodes=9)
    assert inspect.getfullargspec(function).varkw
    passed = {"job_id": 7, "num_procs": 2, "experiment_dir": "here", "experiment_name": "first"}
    assert function(delta=np.float64(9.0), **passed).tolist() == function(delta=9.0).tolist()


def test_wrong_questions_are_refused():
    function = asperity.SceneFunction("quick")
    with pytest.raises(InputError, match=r"hurst given: the function takes hurst, sigma0, delta"):
        function(hurst=0.7)
    with pytest.raises(InputError, match="delta = -1; allowed"):
        function(**POINT, delta=-1.0)
    with pytest.raises(InputError, match=r"colour: outputs are area_percent, force, delta, "):
        asperity.SceneFunction("quick", ["colour"])
    beyond = SCENE + "[contact]\nboundary = 'periodic'\n"
    with pytest.raises(Unsolved, match="no equilibrium"):
        asperity.SceneFunction(Scene.parse(beyond, "s"))(**POINT, delta=1e6)


def test_threads_and_processes_answer_alike(surrogate):
    deltas = np.linspace(4.0, 20.0, 8)
    for function in (asperity.SceneFunction("quick"), asperity.SurrogateFunction(surrogate)):
        asked = partial(pickle.loads(pickle.dumps(function)), **POINT, nodes=17)
        with ThreadPoolExecutor(4) as threads:
            found = threads.map(lambda delta, ask=asked: ask(delta=delta), deltas)
            np.testing.assert_array_equal(list(found), function(**POINT, delta=deltas, nodes=17))


@pytest.mark.parametrize("load", LOADS)
def test_the_solvers_gradient_is_that_by_the_load(load):
    function = asperity.SceneFunction(Scene.parse(SCENE + LOADS[load], "s"), ["force", "delta"])
    at, step = {"delta": 9.0, "pressure": 0.01, "load": 1.5}[load], 1e-4
    found = function.gradient(**POINT, **{load: at})
    assert np.isnan(found[:, :2]).all()
    more, less = (function(**POINT, **{load: at * (1 + way)}) for way in (step, -step))
    np.testing.assert_allclose(found[:, 2], (more - less) / (2 * step * at), rtol=1e-2)


def test_a_surrogate_is_the_same_function_with_a_gradient(surrogate):
    function, scene = asperity.SurrogateFunction(surrogate), Scene.parse(SCENE, "s")
    assert (function.names, function.outputs) == (("hurst", "sigma0", "delta"), ("area", "force"))
    heights = surface_numbered(scene.with_parameters(POINT), 2)
    wanted = Surrogate.load(surrogate).predict(heights, scene.sides, 9.0)
    found = function(**POINT, delta=9.0, surface=2)
    assert found.tolist() == [wanted.area[0], wanted.force[0]]
    gradient = function.gradient(**POINT, delta=9.0, surface=2)
    assert gradient.shape == (2, 3)
    more = function(**POINT, delta=9.1, surface=2)
    np.testing.assert_allclose(gradient[:, 2], (more - found) / 0.1, rtol=0.1)
