"""What pyproject.toml cannot say: packages that are built from a checkout know its commit."""

import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

sys.path.insert(
    0, str(Path(__file__).parent)
)  # pip builds without the folder on the path

from gen.runtime.installation import STAMP, git_commit


class WithCommit(build_py):
    """Copy the packages, and write the commit beside them."""

    def run(self) -> None:
        """Copy what is installed; an editable installation reads the checkout itself."""
        super().run()
        commit = git_commit()
        if commit and not self.editable_mode:
            (Path(self.build_lib) / "gen" / "runtime" / STAMP).write_text(
                commit, encoding="utf-8"
            )


setup(cmdclass={"build_py": WithCommit})
