"""The circumstances of a measurement: date, machine and its load, code, versions."""

import hashlib
import os
import platform
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gen.runtime.installation import git_commit, versions

PACKAGES = (
    *("asperity", "numpy", "scipy", "pyfftw", "h5py", "mpi4py", "scikit-learn", "xgboost"),
    *("xgboost-cpu", "ContactMechanics", "tamaas", "aspher"),
)
"""Packages whose versions are written down where they are installed."""

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("asperity", "bem", "bench", "gen", "learn")
RESULTS = ROOT / "bench" / "results"
CODE = frozenset({".py", ".toml", ".jinja", ".html"})
"""Ends of the names of files that a state of the code consists of."""


def circumstances() -> dict[str, Any]:
    """Return date, commit, state of the code, machine and versions of packages."""
    return {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": git_commit(),
        "state": code_state(),
        "machine": {
            "processor": processor(),
            "cores": os.cpu_count(),
            "system": platform.platform(),
            "threads": os.environ.get("OMP_NUM_THREADS", "not set"),
        },
        "versions": versions(PACKAGES),
    }


def load() -> float:
    """Return how many processes ran or waited on average in the last minute; quiet is near 0."""
    return round(os.getloadavg()[0], 2)


def code_state(root: Path = ROOT) -> str:
    """Return a hash of the code, which documents and results do not change.

    It is that of the sorted paths and contents of all programs, settings and templates of the
    packages under a folder, so it needs no git, and sees what is not committed.
    """
    digest = hashlib.sha256()
    files = (path for name in SOURCES for path in (root / name).rglob("*"))
    results = root / RESULTS.relative_to(ROOT)
    code = (path for path in files if path.suffix in CODE and not path.is_relative_to(results))
    for path in sorted(code):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(root).as_posix()} {len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def processor() -> str:
    """Return the processor's name as Linux tells it, else as Python does."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
