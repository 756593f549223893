"""Stiff and extreme cases of the nine models, their features, splits and scores.

`samples` holds ordinary rows and spoils them, `fitted` fits and asks a surrogate as the product
does, `fit_checks` judges a fit, `fit_cases` and `part_cases` are the rows of the table.
"""
