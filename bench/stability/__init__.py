"""Stiff and extreme cases of the contact solver, each with checks that do not rely on it.

`table` says what is asked, `checks` how an answer is judged, `case` runs, `report` shows.
"""
