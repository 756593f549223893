"""Stiff and extreme cases of the contact solver, each with checks that do not rely on it.

`setup` and `topographies` say what can be asked, `checks` how an answer is judged, `case` joins
both, `elastic_cases` and `hardness_cases` are the rows of the table.
"""
