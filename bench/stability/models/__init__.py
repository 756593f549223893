"""Stiff and extreme cases of the nine models, their features, splits and scores.

`samples` holds ordinary rows and what spoils them, `fitted` fits and asks a surrogate the way the
product does, `optimality` proves a fit from the estimator's own numbers, `*_cases` say what is
asked and judge it, `sheet` is the table of all.
"""
