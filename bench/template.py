"""Texts that reports fill in: templates beside the modules that know the numbers."""

from collections.abc import Mapping
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined


def rendered(name: str, values: Mapping[str, Any], *, markup: bool = False) -> str:
    """Fill in a template of this package; what goes into markup is escaped.

    A line that ends in a backslash goes on in the next one. `form` writes a number:
    `seconds | form(".3g")`.
    """
    environment = Environment(
        loader=PackageLoader("bench", "."),
        autoescape=markup,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["form"] = format
    return environment.get_template(name).render(values).replace("\\\n", "")
