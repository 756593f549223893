"""Surrogates: fitted to a database, stored in one file, and evaluated as often as needed.

Examples
--------
>>> surrogate = Surrogate.load("area.surrogate")
>>> on_surface = surrogate.for_surface(heights, side=1000.0)
>>> answer = on_surface.predict([5.0, 10.0])
>>> answer.area, answer.low["area"], answer.high["area"], answer.reasons
"""

from learn.surrogate.model import OnSurface, Prediction, Surrogate

__all__ = ["OnSurface", "Prediction", "Surrogate"]
