"""The server as clients use it: UM-Bridge's own from Python, and curl."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import umbridge
from databases import database_of
from launch import python
from learnt_rows import surrogate_of

from gen.database import Reader
from learn import Surrogate

SCENE = "samples = 60\nsamples_per_surface = 2\n[surface]\nnodes = 17\n"
TIMEOUT = 60.0
PATIENT = """
from asperity import command
from asperity.serving import protocol
if __name__ == "__main__":
    protocol.SLOW = %s
    raise SystemExit(command.main())
"""


class Served:
    """A server in a process of its own."""

    def __init__(self, folder, *sources, slow=None):
        self.folder, self.sources, self.slow = folder, sources, slow
        for _ in range(5):  # another process may take the port before the server does
            with socket.socket() as free:
                free.bind(("127.0.0.1", 0))
                self.port = free.getsockname()[1]
            self.address = f"http://127.0.0.1:{self.port}"
            if self.start():
                return
        raise AssertionError(self.process.stdout.read())

    def start(self):
        line = ["serve", *self.sources, "--port", str(self.port), "--processes", "2"]
        program = ["-m", "asperity"] if self.slow is None else ["-c", PATIENT % self.slow]
        self.process = subprocess.Popen(
            [sys.executable, *program, *line],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,  # a terminal sends Ctrl-C to the workers too
        )
        return b"serving" in self.process.stdout.readline()

    def ask(self, route, body, raw=None, headers=None):
        data = raw or json.dumps(body).encode()
        request = urllib.request.Request(f"{self.address}/{route}", data, headers or {})
        try:
            with urllib.request.urlopen(request, timeout=TIMEOUT) as answer:
                return answer.status, json.load(answer, parse_constant=pytest.fail)
        except urllib.error.HTTPError as error:
            return error.code, json.load(error, parse_constant=pytest.fail)

    def end(self, number=signal.SIGTERM):
        self.process.send_signal(number)
        code = self.process.wait(TIMEOUT)
        self.process.stdout.close()
        return code


def children(pid):
    """Processes that a process has started."""
    listed = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(each) for each in listed if "spawn_main" in words_of(each)]


def words_of(pid):
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode()
    except OSError:
        return ""


def gone(pid, limit=TIMEOUT):
    until = time.monotonic() + limit
    while time.monotonic() < until:
        if not words_of(pid):
            return True
        time.sleep(0.05)
    return False


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("served")
    small = database_of(folder, SCENE, "small")
    surrogate_of(small, "--target", "area", "--model", "kernel-ridge", name="learnt")
    few = database_of(folder, SCENE.replace("surface = 2", "surface = 6"), "few")
    surrogate_of(few, "--target", "force", "--model", "kernel-ridge")
    return folder


@pytest.fixture(scope="module")
def served(folder):
    served = Served(folder, "small.toml", "learnt.surrogate", "few.surrogate")
    yield served
    assert served.end() == 0


def rows(folder):
    """Inputs, configuration and outputs of every row of the database."""
    with Reader(folder / "small.h5") as reader:
        names = ("hurst", "sigma0", "delta", "surface", "area_percent", "force")
        columns = [reader.column(name).tolist() for name in names]
    for hurst, sigma0, delta, surface, area, force in zip(*columns, strict=True):
        yield [[hurst, sigma0], [delta]], {"surface": surface}, [[area], [force], [delta]]


@pytest.mark.few(1)
def test_the_solver_answers_with_the_rows_of_the_database(folder, served):
    model = umbridge.HTTPModel(served.address, "small")
    assert umbridge.supported_models(served.address) == ["small", "learnt", "few"]
    assert model.get_input_sizes() == [2, 1]
    assert model.get_output_sizes() == [1, 1, 1]
    for inputs, config, outputs in list(rows(folder))[:20]:
        assert model(inputs, config) == outputs


def test_the_stiffness_is_an_output_on_request(served):
    """Centred differences of the force, where the contact set stands still."""
    model, config = umbridge.HTTPModel(served.address, "small"), {"stiffness": True}
    assert model.get_output_sizes(config) == [1, 1, 1, 1]
    inputs, step = [[0.7, 12.0], [10.0]], 1e-4
    above, below = (model([inputs[0], [10.0 + way * step]])[1][0] for way in (1, -1))
    *plain, (slope,) = model(inputs, config)
    assert slope == pytest.approx((above - below) / (2 * step), rel=1e-5)
    assert plain == model(inputs)


MODELS = pytest.mark.parametrize("name", ["small", "learnt"])
"""A model of each kind; with them, the checks of UM-Bridge's suite of conformity 1.0."""

DERIVATIVES = pytest.mark.parametrize(
    "route", ["Gradient", "ApplyJacobian", "ApplyHessian"]
)


def assert_refused(served, route, kind, **body):
    """A question has to be answered by an error of the protocol of this kind."""
    status, answer = served.ask(route, body)
    assert (status, list(answer)) == (400, ["error"])
    assert sorted(answer["error"]) == ["message", "type"]
    assert answer["error"]["type"] == kind
    assert isinstance(answer["error"]["message"], str)


def answer_of(served, route, key, **body):
    """The value of the only key of an answer that is no error."""
    status, answer = served.ask(route, body)
    assert (status, list(answer)) == (200, [key])
    return answer[key]


def vectors_of(served, name):
    """Vectors of the sizes that a model asks for."""
    sizes = answer_of(served, "InputSizes", "inputSizes", name=name)
    return [[0.7] * size for size in sizes]


def test_the_server_tells_version_and_models(served):
    with urllib.request.urlopen(f"{served.address}/Info", timeout=TIMEOUT) as answer:
        info = json.load(answer)
    assert info == {"protocolVersion": 1.0, "models": ["small", "learnt", "few"]}


@pytest.mark.parametrize(
    "route", ["Evaluate", "ModelInfo", "InputSizes", "OutputSizes", "Gradient"]
)
def test_unknown_models_are_not_found(served, route):
    assert_refused(served, route, "ModelNotFound", name="wrong_model_name")


@MODELS
def test_a_model_tells_that_it_supports_evaluation_alone(served, name):
    support = answer_of(served, "ModelInfo", "support", name=name)
    features = ("Evaluate", "Gradient", "ApplyJacobian", "ApplyHessian")
    assert support == dict(zip(features, (True, False, False, False), strict=True))


@MODELS
@pytest.mark.parametrize("kind", ["input", "output"])
def test_sizes_are_whole_numbers_above_0(served, name, kind):
    sizes = answer_of(served, f"{kind.title()}Sizes", f"{kind}Sizes", name=name)
    assert sizes
    assert all(type(size) is int and size > 0 for size in sizes)


@MODELS
def test_an_output_has_the_sizes_that_the_model_tells(served, name):
    question = {"name": name, "input": vectors_of(served, name), "config": {}}
    output = answer_of(served, "Evaluate", "output", **question)
    sizes = answer_of(served, "OutputSizes", "outputSizes", name=name)
    assert [len(vector) for vector in output] == sizes
    assert all(type(number) in {int, float} for vector in output for number in vector)


@MODELS
def test_an_input_of_other_sizes_is_refused(served, name):
    too_long = [[*vector, 0.7] for vector in vectors_of(served, name)]
    assert_refused(served, "Evaluate", "InvalidInput", name=name, input=too_long)


@MODELS
@DERIVATIVES
def test_derivatives_are_not_supported(served, name, route):
    assert_refused(served, route, "UnsupportedFeature", name=name)


@MODELS
@DERIVATIVES
def test_derivatives_by_vectors_that_a_model_lacks_are_refused(served, name, route):
    vectors = vectors_of(served, name)
    outputs = len(answer_of(served, "OutputSizes", "outputSizes", name=name))
    for key, size in (("outWrt", outputs), ("inWrt", len(vectors))):
        for index in (size, -1):
            question = {"name": name, "input": vectors, key: index}
            assert_refused(served, route, "InvalidInput", **question)


def test_nodes_and_seed_are_settings(served):
    model, inputs = umbridge.HTTPModel(served.address, "small"), [[0.7, 12.0], [10.0]]
    answers = [model(inputs, {**config}) for config in ({}, {"nodes": 33}, {"seed": 5})]
    assert len({answer[0][0] for answer in answers}) == 3
    assert model(inputs, {"nodes": 17, "seed": 2025, "surface": 0}) == answers[0]


BAD = [
    (
        "Evaluate",
        {"name": "small", "input": [[0.7, 12.0], ["x"]]},
        "InvalidInput",
        "input.1.0",
    ),
    (
        "Evaluate",
        {"name": "small", "input": [[7.0, 12.0], [9.0]]},
        "InvalidInput",
        "hurst",
    ),
    (
        "Evaluate",
        {"name": "small", "input": [[0.7, 12.0], [-9.0]]},
        "InvalidInput",
        "delta",
    ),
    (
        "Evaluate",
        {"name": "small", "input": [[0.7, 12.0], [1e308]]},
        "InvalidInput",
        "1e+305",
    ),
    ("Gradient", {"name": "small", "inWrt": 10**400}, "InvalidInput", "inWrt"),
    (
        "Evaluate",
        {"name": "learnt", "config": {"stiffness": 1}},
        "InvalidInput",
        "stiffness",
    ),
    ("Nothing", {}, "InvalidInput", "Nothing"),
]


@pytest.mark.parametrize(("route", "body", "kind", "word"), BAD)
def test_bad_questions_get_the_protocols_error(served, route, body, kind, word):
    status, answer = served.ask(route, body)
    assert status in {400, 404}
    assert answer["error"]["type"] == kind
    assert word in answer["error"]["message"]
    assert "\n" not in answer["error"]["message"]


ASKED = b'{"name": "small", "input": [[0.7, 12.0], [9.0]], %s}'


@pytest.mark.parametrize(
    "raw",
    [
        *(b"{", b"[]", b"\xff\xfe", b'{"name": "small", "input": [[NaN]]}', b"[" * 10**5),
        *(ASKED % (b'"config": ' + b'{"a": ' * n + b"1" + b"}" * n) for n in (3, 3000)),
        ASKED % b'"outWrt": 1, "inWrt": 1, "sens": [-Infinity]',
        b'{"name": "small", "input": [[0.7, 12.0], [1e400]]}',
    ],
    ids=repr,
)
@pytest.mark.parametrize("route", ["Evaluate", "ApplyHessian"])
def test_bodies_that_are_no_questions_get_the_protocols_error(served, route, raw):
    status, answer = served.ask(route, None, raw)
    assert (status, answer["error"]["type"]) == (400, "InvalidInput")


@pytest.mark.parametrize("encoding", ["deflate", "zstd"])
@pytest.mark.parametrize(
    "raw", [b"damaged", zlib.compress(b"{}")[:-3], zlib.compress(b" " * 10**7)]
)
def test_damaged_and_compressed_bodies_get_the_protocols_error(served, encoding, raw):
    status, answer = served.ask("Evaluate", None, raw, {"Content-Encoding": encoding})
    assert (status, answer["error"]["type"]) == (400, "InvalidInput")


def test_a_surrogate_of_few_surfaces_answers_at_the_largest_level_that_holds(
    folder, served
):
    """And the server tells which, once it has begun."""
    surrogate = Surrogate.load(folder / "few.surrogate")
    level = surrogate.largest_level
    assert level < 0.9
    said = served.process.stdout.readline().decode()
    assert said.startswith(f"few: intervals of {100 * level:g} %: ")
    with Reader(folder / "few.h5") as reader:
        hurst, sigma0, delta = (
            float(reader.column(n)[6]) for n in ("hurst", "sigma0", "delta")
        )
    question = {
        "name": "few",
        "input": [[hurst, sigma0], [delta]],
        "config": {"surface": 1},
    }
    status, answer = served.ask("Evaluate", question)
    assert status == 200
    [[value, low, high, _]] = answer["output"]
    assert low < value < high


def test_outside_the_training_both_ends_of_the_interval_are_null(served):
    model = umbridge.HTTPModel(served.address, "learnt")
    ((value, low, high, inside),) = model([[0.7, 12.0], [1e5]])
    assert np.isfinite(value)
    assert (low, high, inside) == (None, None, 0)


@pytest.mark.parametrize("host", ["evil.example:4242", "[", "127.0.0.1.evil.org"])
def test_names_that_are_not_the_servers_are_refused(served, host):
    """A page of the web can let its own name point to this machine."""
    status, answer = served.ask("InputSizes", {"name": "small"}, headers={"Host": host})
    assert (status, answer["error"]["type"]) == (400, "InvalidInput")
    for own in ("LOCALHOST:1", "127.0.0.1:4242", "[::1]:80"):
        assert (
            served.ask("InputSizes", {"name": "small"}, headers={"Host": own})[0] == 200
        )


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "https://localhost:1", ""]
)
def test_pages_of_others_are_refused(served, origin):
    """A browser names where a page that asks comes from; programs say nothing of the kind."""
    headers = {"Host": "localhost:1", "Origin": origin}
    status, answer = served.ask("InputSizes", {"name": "small"}, headers=headers)
    assert (status, answer["error"]["type"]) == (400, "InvalidInput")
    headers["Origin"] = "http://localhost:1"
    assert served.ask("InputSizes", {"name": "small"}, headers=headers)[0] == 200


@pytest.mark.parametrize(
    "wrong",
    [
        {"input": [[True, 12.0], [0.5]]},
        {"input": [["0.6", 12.0], [0.5]]},
        {"outWrt": True},
        {"inWrt": "0"},
        {"config": {"surface": True}},
    ],
)
def test_texts_and_truths_are_no_numbers(served, wrong):
    question = {"name": "small", "input": [[0.7, 12], [0.5]], **wrong}
    for route in ("Evaluate", "Gradient"):
        status, answer = served.ask(route, question)
        assert (status, answer["error"]["type"]) == (400, "InvalidInput")
        assert next(iter(wrong)) in answer["error"]["message"]


@pytest.mark.long
@pytest.mark.parametrize(
    ("sent", "answered"),
    [
        (b"POST /Evaluate HTTP/1.1\r\nHost: localhost\r\nContent-Le", b""),
        (
            b"POST /Evaluate HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n\r\n{",
            b"not sent",
        ),
    ],
    ids=["header", "body"],
)
def test_slow_clients_are_dropped(folder, sent, answered):
    served = Served(folder, "small.toml", slow=0.5)
    with socket.create_connection(("127.0.0.1", served.port), timeout=TIMEOUT) as client:
        client.sendall(sent)
        received = b""
        while part := client.recv(2**16):
            received += part
    assert answered in received
    assert served.end() == 0


@pytest.mark.long
def test_a_thousand_calls_eight_at_once_while_workers_and_server_are_killed(folder):
    """No answer is wrong or lost: a client that is refused asks again."""
    served = Served(folder, "small.toml")
    known = list(rows(folder))
    calls = [known[number % len(known)] for number in range(1000)]
    model = umbridge.HTTPModel(served.address, "small")

    def asked(call):
        inputs, config, outputs = call
        until = time.monotonic() + TIMEOUT
        while time.monotonic() < until:
            try:
                return model(inputs, config) == outputs
            except (
                Exception
            ):  # the server is away: the client's own error, of whichever kind
                time.sleep(0.1)
        return False

    with ThreadPoolExecutor(8) as clients:
        answers = [clients.submit(asked, call) for call in calls]
        while sum(answer.done() for answer in answers) < 200:
            time.sleep(0.01)
        os.kill(children(served.process.pid)[0], signal.SIGKILL)
        while sum(answer.done() for answer in answers) < 500:
            time.sleep(0.01)
        orphans = children(served.process.pid)
        served.end(signal.SIGKILL)
        assert served.start()
        assert all(answer.result() for answer in answers)
    assert all(gone(pid) for pid in orphans)
    assert served.end(signal.SIGINT) in {0, 130}


@pytest.mark.parametrize(("presses", "nodes"), [(1, 257), (2, 4097)])
def test_ctrl_c_lets_a_question_end_and_a_second_one_does_not(folder, presses, nodes):
    """Pressed as soon as the worker has been started, while it still imports."""
    served = Served(folder, "small.toml")
    question = {
        "name": "small",
        "input": [[0.7, 12.0], [10.0]],
        "config": {"nodes": nodes},
    }
    with ThreadPoolExecutor(1) as client:
        answer = client.submit(served.ask, "Evaluate", question)
        while not (workers := children(served.process.pid)):
            time.sleep(0.01)
        os.killpg(served.process.pid, signal.SIGINT)
        assert b"stopping" in served.process.stdout.readline()
        if presses == 2:
            os.killpg(served.process.pid, signal.SIGINT)
        assert answer.result()[0] == (200 if presses == 1 else 500)
        said = served.process.stdout.read().decode()
        assert said == "", said
    assert served.end() == (0 if presses == 1 else 128 + signal.SIGINT)
    assert all(gone(pid) for pid in workers)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["nothing"], "nothing"),
        (["small.toml", "small.toml"], "one name"),
        (["small.toml", "--port", "PORT"], "address already in use"),
        (["small.toml", "--host", "no.such.host.invalid"], "no.such.host"),
    ],
)
def test_bad_command_lines_get_one_line(folder, served, arguments, word):
    arguments = [str(served.port) if each == "PORT" else each for each in arguments]
    done = python("-m", "asperity", "serve", *arguments, folder=folder)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert word in done.stderr
