"""Asperity's databases of rough-surface contact: scenes, surfaces, statistics, and their runs.

`generation` plans, computes and checks rows, `database` keeps them, `measured` reads surfaces of
instruments and presses them one by one, `runtime` is what every command of the project runs on.
"""
