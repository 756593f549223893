"""One thread a process, and hypothesis without its clock: machines under load are slow."""

import os

for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ[f"{library}_NUM_THREADS"] = "1"

from hypothesis import settings  # noqa: E402

settings.register_profile("project", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("project")
