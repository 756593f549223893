"""Where, when and with what something was measured."""

import os
import platform
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gen.runtime.provenance import git_commit, versions

PACKAGES = (
    *("asperity", "numpy", "scipy", "pyfftw", "h5py", "mpi4py", "scikit-learn", "xgboost"),
    *("xgboost-cpu", "ContactMechanics", "tamaas", "aspher"),
)
"""What may take part: the versions of those that are installed are written down."""


def circumstances() -> dict[str, Any]:
    """Return date, commit, machine and versions of packages, to be kept beside a measurement."""
    return {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": git_commit(),
        "machine": {
            "processor": processor(),
            "cores": os.cpu_count(),
            "system": platform.platform(),
            "threads": os.environ.get("OMP_NUM_THREADS", "not set"),
        },
        "versions": versions(PACKAGES),
    }


def processor() -> str:
    """Return the processor's name as Linux tells it, else as Python does."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
