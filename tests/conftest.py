"""One thread a process, and hypothesis without its clock: machines under load are slow.

Under pytest-xdist a file's tests stay together, for the sake of their fixtures, and all that start
mpiexec take turns: two worlds of eight ranks at once would wait for each other on few processors.
"""

import os

for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ[f"{library}_NUM_THREADS"] = "1"

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

settings.register_profile("project", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("project")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.pluginmanager.hasplugin("xdist"):
        for item in items:
            together = "mpi" if item.get_closest_marker("mpi") else str(item.path)
            item.add_marker(pytest.mark.xdist_group(together))
