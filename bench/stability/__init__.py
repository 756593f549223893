"""Stiff and extreme cases of the solver, of surfaces and of models, each judged independently.

`solver`, `surfaces` (generators and statistics) and `models` hold a table each, made of cases with
`finding`s; `sheet` says how a table is run and shown, `report` is the command, `contents` the page.
"""
