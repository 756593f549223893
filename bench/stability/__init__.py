"""Stiff and extreme cases of the solver, of surfaces and of models, each judged independently.

`case` says what a case is and runs it, `tables` lists the tables, prints and writes them. The cases
themselves stand in `solver`, `loads`, `hardness`, `surfaces` (generators and statistics), `models`.
"""
