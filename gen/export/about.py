"""A publisher's entries on a dataset: title, creator, licence, DOI."""

import re
from dataclasses import dataclass
from typing import Self

from gen.database import Reader
from gen.runtime.errors import InputError
from gen.runtime.terminal import printable

DOI = re.compile(r"10\.\d{4,9}/\S+")
"""A digital object identifier without the address of its resolver (ISO 26324)."""

LICENCE = re.compile(r"https?://\S+|[\w.+-]+( (AND|OR|WITH) [\w.+-]+)*", re.ASCII)
"""An address, or an SPDX expression without brackets (SPDX 2.3, annex D)."""

PREFIXES = ("https://doi.org/", "http://doi.org/", "doi:")
"""Beginnings that people put in front of an identifier."""


@dataclass(frozen=True)
class About:
    """Bibliographic data of a dataset; an empty text where nothing was given.

    Attributes
    ----------
    title : str
        Title of the dataset.
    creator : str
        Persons or organisation, as they want to be cited.
    licence : str
        SPDX identifier as "CC-BY-4.0", or the address of a licence.
    doi : str
        Digital object identifier, without the address of its resolver.
    """

    title: str
    creator: str = ""
    licence: str = ""
    doi: str = ""

    @classmethod
    def of(cls, reader: Reader, title: str, creator: str, licence: str, doi: str) -> Self:
        """Complete the options of a command by the entries of the database.

        Parameters
        ----------
        reader : Reader
            Database.
        title, creator, licence, doi : str
            Options of the command, empty if not given.

        Returns
        -------
        About
            An option where one was given, else the attribute of the database.

        Raises
        ------
        InputError
            If an identifier is none, or an option has more than one line; letters of the
            database that cannot be printed become question marks.
        """
        scene = reader.scene
        stored = str(reader.attributes["title"]), scene.creator or "", scene.licence or ""
        own = [*map(printable, stored)]
        about = cls(title or own[0], creator or own[1], licence or own[2], _bare(doi))
        for option, text in (("title", title), ("creator", creator), ("licence", licence)):
            if not text.isprintable():
                raise InputError(f"--{option} {text!r}: give a text of one line")
        if licence and not LICENCE.fullmatch(licence):
            raise InputError(
                f"--licence {licence!r}: give an SPDX identifier as CC-BY-4.0, or an address that"
                " begins with https://"
            )
        return about

    @property
    def address(self) -> str:
        """Address that the identifier resolves to, or an empty text."""
        return f"https://doi.org/{self.doi}" if self.doi else ""

    def citation(self, year: str) -> str:
        """Return how the dataset wants to be cited, or an empty text without a creator."""
        place = f" {self.address}" if self.address else ""
        return f"{self.creator} ({year}). {self.title} [Data set].{place}" if self.creator else ""


def _bare(doi: str) -> str:
    """Take the resolver off an identifier; refuse a text that is no identifier."""
    bare = doi.strip()
    for prefix in PREFIXES:
        if bare.lower().startswith(prefix):
            bare = bare[len(prefix) :]
    if doi and not DOI.fullmatch(bare):
        raise InputError(f"--doi {doi}: give an identifier as 10.5281/zenodo.1234567")
    return bare
