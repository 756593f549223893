"""What a search has found: one folder each, with all that the command needs to fail again."""

import shlex
import shutil
from collections import Counter
from pathlib import Path

from tests.fuzz.search import Case


class Findings:
    """Findings of a search, by their signatures; the first of each is kept.

    Parameters
    ----------
    folder : for the reproducers, made when there is one

    Attributes
    ----------
    cases : cases that were run
    signatures : number of findings of each signature
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.cases = 0
        self.signatures: Counter[str] = Counter()

    def add(self, case: Case, worked: Path) -> str:
        """Count a case; keep what is new of it.

        Parameters
        ----------
        case : any
        worked : the folder in which it ran

        Returns
        -------
        What to tell, "" of a case that ended as it should or is known
        """
        self.cases += 1
        if not case.fault:
            return ""
        self.signatures[case.signature] += 1
        if self.signatures[case.signature] > 1:
            return ""
        kept = self._folder / f"{len(self.signatures):03}-{case.kind}"
        shutil.copytree(worked, kept, symlinks=True)
        command = shlex.join(["python", "-m", *case.command])
        (kept / "command.txt").write_text(command + "\n", encoding="utf-8")
        said = case.ended.errors + case.ended.output
        (kept / "said.txt").write_text(f"{case.fault}\n{said}", encoding="utf-8")
        return f"case {case.number}: {command}: {case.fault}: {kept}"

    def summary(self, seconds: float) -> str:
        """Return the outcome in one line."""
        found = sum(self.signatures.values())
        return (
            f"{self.cases} cases in {seconds:.0f} s; {found} findings of"
            f" {len(self.signatures)} kinds: a signal, a hang, a traceback, a library's warning or"
            " no clear line"
        )
