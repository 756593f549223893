"""The files of a report: its tables, records, words and pictures, written into one folder."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bench.picture import save
from bench.table import write_rows
from gen.runtime.output import make_folder, write


@dataclass(frozen=True, eq=False)
class Report:
    """Results that are ready to be written.

    Attributes
    ----------
    tables : mapping of str to rows
        Rows (see `bench.table.write_rows`) by the name of their file, without ending.
    records : mapping of str to JSON
        Anything that JSON can hold by the name of its file, without ending.
    pictures : mapping of str to figure
        Figures by the name of their file, without ending.
    text : str
        Words for people; empty if there are none.
    text_name : str
        Name of the file that keeps the text, without ending; empty if it is only printed.
    """

    tables: Mapping[str, Iterable[Any]]
    records: Mapping[str, Any] = field(default_factory=dict)
    pictures: Mapping[str, Any] = field(default_factory=dict)
    text: str = ""
    text_name: str = ""

    def write(self, folder: Path) -> list[Path]:
        """Write all files into a folder, which is made where there is none.

        Raises
        ------
        InputError
            If the folder cannot be written to.
        """
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
