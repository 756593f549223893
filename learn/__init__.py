"""Asperity's surrogates of contact databases: nine models compared, tuned, judged, put to use.

`from learn import Surrogate` loads what `asperity learn fit` has made.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from learn.surrogate import Prediction, Surrogate

__all__ = ["Prediction", "Surrogate"]


def __getattr__(name: str) -> Any:
    """Import numerical packages only when a name needs them: `--help` does not."""
    if name in __all__:
        from learn import surrogate

        return getattr(surrogate, name)
    raise AttributeError(f"module 'learn' has no attribute {name!r}")
