"""The processes of the server: what becomes of clients that leave, and of too many questions."""

import asyncio
import resource
from pathlib import Path

import pytest

from asperity.serving import workers
from asperity.serving.models import Configuration
from asperity.serving.workers import Call, Refusal, Workers
from gen.runtime.user_code import TRUSTED

LIMIT = 60.0
MODULE = """
import time
from pathlib import Path

def waves(shape, spacing, rng, seconds):
    with Path("asked").open("a") as file:
        file.write(f"{seconds:g}\\n")
    time.sleep(seconds)
    return rng.normal(size=shape)
"""
SCENE = """
samples = 10
[surface]
generator = "python"
function = "sleeping:waves"
nodes = 9
parameters = { seconds = [0.0, 1e6] }
"""
FOREVER, AT_ONCE = 1e5, 0.0


@pytest.fixture
def folder(here):
    (here / "sleeping.py").write_text(MODULE)
    (here / "scene.toml").write_text(SCENE)
    trust = TRUSTED.set(True)
    yield here
    TRUSTED.reset(trust)


def call(seconds):
    return Call("scene", [[seconds], [0.5]], Configuration())


def asked(folder):
    """How long the surfaces took that were begun."""
    path = folder / "asked"
    return [float(line) for line in path.read_text().split()] if path.exists() else []


async def until(condition):
    async with asyncio.timeout(LIMIT):
        while not condition():
            await asyncio.sleep(0.02)


def test_questions_of_clients_that_left_are_not_computed(folder, monkeypatch):
    """The one that a process computes is ended after a while, those that wait at once."""
    monkeypatch.setattr(workers, "GRACE", 0.2)

    async def leave():
        pool = Workers(["scene.toml"], 1)
        try:
            clients = [asyncio.create_task(pool.ask(call(FOREVER))) for _ in range(20)]
            await until(lambda: asked(folder))
            for client in clients:
                client.cancel()
            async with asyncio.timeout(LIMIT):
                return await pool.ask(call(AT_ONCE))
        finally:
            pool.close()

    assert len(asyncio.run(leave())) == 3
    assert asked(folder) == [FOREVER, AT_ONCE]


def test_processes_that_nobody_needs_open_no_files(folder):
    before = len(list(Path("/proc/self/fd").iterdir()))
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    try:
        pool = Workers(["scene.toml"], 1024)
        assert len(list(Path("/proc/self/fd").iterdir())) <= before + 1
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        assert soft >= min(hard, 8 * 1024)
        pool.close()
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)


def test_a_question_that_ends_soon_after_its_client_left_keeps_the_process(
    folder, monkeypatch
):
    monkeypatch.setattr(workers, "GRACE", LIMIT)

    async def leave():
        pool = Workers(["scene.toml"], 1)
        try:
            client = asyncio.create_task(pool.ask(call(1.0)))
            await until(lambda: asked(folder))
            before = set(pool._pools)
            client.cancel()
            await pool.ask(call(AT_ONCE))
            return before == pool._pools
        finally:
            pool.close()

    assert asyncio.run(leave())


@pytest.mark.long
def test_more_questions_than_may_wait_are_refused(folder, monkeypatch):
    monkeypatch.setattr(workers, "WAITING", 3)
    monkeypatch.setattr(workers, "GRACE", 0.0)

    async def crowd():
        pool = Workers(["scene.toml"], 1)
        try:
            clients = [asyncio.create_task(pool.ask(call(FOREVER))) for _ in range(4)]
            await asyncio.sleep(0)  # one is computed, three wait
            with pytest.raises(Refusal) as refused:
                await pool.ask(call(AT_ONCE))
            for client in clients:
                client.cancel()
            await asyncio.sleep(0)
            await pool.ask(call(AT_ONCE))
            return refused.value
        finally:
            pool.close()

    refusal = asyncio.run(crowd())
    assert (refusal.kind, refusal.status) == ("Busy", 503)
    assert "later" in refusal.message


def test_questions_that_wait_are_refused_when_the_server_ends(folder):
    async def end():
        pool = Workers(["scene.toml"], 1)
        clients = [asyncio.create_task(pool.ask(call(FOREVER))) for _ in range(3)]
        await until(lambda: asked(folder))
        pool.close()
        async with asyncio.timeout(LIMIT):
            return await asyncio.gather(*clients, return_exceptions=True)

    answers = asyncio.run(end())
    assert [type(answer) for answer in answers] == [Refusal] * 3
    assert {answer.kind for answer in answers} == {"ModelError"}
