"""Stiff and extreme cases of generators and statistics.

`exact` computes both again in whole numbers and fractions, `checks` compares, `generator_cases` and
`statistics_cases` are the rows of the table.
"""
