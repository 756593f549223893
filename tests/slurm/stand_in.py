"""Environments for jobs: one whose python is a few lines of shell, one that lends a real one's."""

import shutil
import site
import subprocess
import sys
from pathlib import Path


def environment_with_python(folder: Path, script: str) -> Path:
    """An environment whose `python` is a shell script: it crashes or sleeps as a test needs it."""
    python = folder / "stand-in" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(f"#!/bin/bash\n{script}\n")
    python.chmod(0o755)
    return python.parents[1]


def thin_environment(folder: Path, notes: Path) -> Path:
    """A small virtual environment with this one's packages and MPI, which notes where it runs."""
    path = folder / "thin"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", path], check=True, timeout=60)
    (packages,) = path.glob("lib/python*/site-packages")
    lent = "\n".join(f"import site; site.addsitedir({name!r})" for name in site.getsitepackages())
    (packages / "lent.pth").write_text(f"{lent}\n")
    (packages / "sitecustomize.py").write_text(
        f"import sys; print(sys.prefix, file=open({str(notes)!r}, 'a'))\n"
    )
    lent_files = ("bin/mpiexec", "bin/hydra_pmi_proxy", "lib/libmpi.so.12", "lib/mpich")
    for name in lent_files:
        source = Path(sys.prefix) / name
        copy = shutil.copytree if source.is_dir() else shutil.copy
        copy(source, path / name)
    return path
