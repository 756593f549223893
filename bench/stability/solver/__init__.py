"""Stiff and extreme cases of the contact solver, each with checks that do not rely on it.

`*_cases` and `setup` say what is asked, `checks` how an answer is judged, `case` runs, `sheet`
shows.
"""
