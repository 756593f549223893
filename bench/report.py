"""The files of a report: its tables, records, words and pictures, written into one folder."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import typer

from bench.picture import save
from bench.table import write_rows
from gen.runtime.files import make_folder, write


def remark(line: str) -> None:
    """Print a line to standard error: how far a report is."""
    typer.echo(line, err=True)


@dataclass(frozen=True, eq=False)
class Report:
    """Results that are ready to be written, by the names of their files without ending.

    Tables are rows with the same columns, records are what JSON can hold. The text
    is for people: printed, and kept in a file if `text_name` names one.
    """

    tables: Mapping[str, Iterable[Any]]
    records: Mapping[str, Any] = field(default_factory=dict)
    pictures: Mapping[str, Any] = field(default_factory=dict)
    text: str = ""
    text_name: str = ""

    def write(self, folder: Path) -> list[Path]:
        """Write all files into a folder, which is made where there is none."""
        make_folder(folder)
        paths = [write_rows(folder / f"{name}.csv", rows) for name, rows in self.tables.items()]
        texts = {
            f"{name}.json": json.dumps(record, indent=2, ensure_ascii=False)
            for name, record in self.records.items()
        }
        if self.text_name:
            texts[f"{self.text_name}.txt"] = self.text
        for name, text in texts.items():
            paths.append(folder / name)
            write(paths[-1], text + "\n")
        drawn = self.pictures.items()
        return [*paths, *(save(figure, folder / f"{name}.png") for name, figure in drawn)]
