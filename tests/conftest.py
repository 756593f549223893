"""One thread a process, and hypothesis without its clock: machines under load are slow."""

import os
import re

for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ[f"{library}_NUM_THREADS"] = "1"

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

settings.register_profile("project", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("project")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Of a test that is marked `few(n)`, leave n cases in `make test`; skip MPI where none is."""
    from launch import mpiexec

    cases, alone = (
        {},
        pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: extra 'mpich'"),
    )
    for item in items:
        if item.get_closest_marker("mpi"):
            item.add_marker(alone)
        if item.get_closest_marker("few"):
            cases.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for found in cases.values():
        (number,) = found[0].get_closest_marker("few").args
        kept = {place * len(found) // number for place in range(number)}
        for place, item in enumerate(found):
            if place not in kept:
                item.add_marker(pytest.mark.long)


@pytest.fixture(scope="session", autouse=True)
def plain_numbers():
    """No line that any test sees printed has a number as NumPy writes it, np.float64(5.0)."""
    from gen.runtime import terminal

    printable = terminal.printable

    def checked(text):
        assert not re.search(r"\bnp\.\w+\(", text), text
        return printable(text)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(terminal, "printable", checked)
        yield


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder, in which the test works."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def path(tmp_path):
    """A place for a database."""
    return tmp_path / "some.h5"


@pytest.fixture
def refused(capsys):
    """Run a command line that is refused by code 2; return its line, and the list below it."""

    def line(program, *arguments):
        capsys.readouterr()
        assert program.main([str(argument) for argument in arguments]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        _, *listed = said.err.splitlines()
        assert all(line.startswith("  ") for line in listed), said.err
        return said.err

    return line


@pytest.fixture(scope="session")
def populations(tmp_path_factory):
    """A folder with a scene and a database for each of `POPULATIONS`, whose function is trusted."""
    from databases import database_of
    from small_populations import MAPS, POPULATIONS

    from bench.made_maps import write_all
    from gen.runtime.user_code import TRUSTED

    trust = TRUSTED.set(True)
    folder = tmp_path_factory.mktemp("populations")
    write_all(folder / "maps", MAPS)
    for name, scene in POPULATIONS.items():
        database_of(folder, scene, name)
    yield folder
    TRUSTED.reset(trust)


@pytest.fixture
def untrusted():
    """No function of a file is trusted, whatever `populations` has set for its session."""
    from gen.runtime.user_code import TRUSTED

    trust = TRUSTED.set(False)
    yield
    TRUSTED.reset(trust)
