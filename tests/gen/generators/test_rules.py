"""A generator of our own, as docs/how-to/scenes.md describes it: a file and a place in a list."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
SCENE = """samples = 4
[surface]
generator = "ridges"
nodes = [24, 20]
side = 100.0
amplitude = [1.0, 2.0]
wavelength = 25.0
[delta]
pieces = [{ share = 1.0, range = [0.5, 1.0] }]
"""
LOOK = """from gen.database import Reader
with Reader("ridges.h5") as rows:
    print(*(f"{value:.6f}" for value in rows.column("amplitude")), rows.counts().done)
    print({column.name: column.long_name for column in rows.columns()}["wavelength"])
"""


def test_a_generator_is_one_file_and_a_line(tmp_path):
    manual = (ROOT / "docs/how-to/scenes.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n# gen/generators/ridges.py\n(.*?)```", manual, re.DOTALL)
    shutil.copytree(ROOT / "gen", tmp_path / "gen", ignore=shutil.ignore_patterns("__pycache__"))
    generators = tmp_path / "gen/generators"
    (generators / "ridges.py").write_text(code)
    registry = (generators / "__init__.py").read_text()
    registry = registry.replace(
        "    PythonSurface,\n)", "    PythonSurface,\n    RidgedSurface,\n)"
    )
    line = "from gen.generators.rules import GeneratedSurface\n"
    own = "from gen.generators.ridges import RidgedSurface\n"
    (generators / "__init__.py").write_text(registry.replace(line, own + line))
    (tmp_path / "ridges.toml").write_text(SCENE)

    def python(*arguments):
        done = subprocess.run(
            [sys.executable, *arguments],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(tmp_path)},
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
        )
        return done.returncode, done.stdout, done.stderr

    code, _, trouble = python("-m", "gen", "run", "ridges.toml", "-o", "ridges.h5")
    assert code == 0, trouble
    code, told, trouble = python("-m", "gen", "check", "ridges.h5", "--recompute", "4")
    assert code == 0, told + trouble
    numbers, meaning = python("-c", LOOK)[1].splitlines()
    *amplitudes, done = map(float, numbers.split())
    assert all(1 <= amplitude <= 2 for amplitude in amplitudes)
    assert len(set(amplitudes)) == done == 4
    assert meaning == "distance of the ridges"
    code, _, trouble = python("-m", "gen", "columns")
    assert code == 0, trouble
    (tmp_path / "ridges.toml").write_text(SCENE.replace("ridges", "ridge"))
    code, _, trouble = python("-m", "gen", "run", "ridges.toml", "-o", "none.h5")
    assert code == 2
    assert "'ridges'" in trouble
