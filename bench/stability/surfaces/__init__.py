"""Stiff and extreme cases of generators and statistics.

`exact` computes both again in whole numbers and fractions; `generator_cases` and `statistics_cases`
say what is asked and judge it, `sheet` is the table of all.
"""
