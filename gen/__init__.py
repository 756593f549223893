"""Asperity's databases of rough-surface contact: scenes, surfaces, statistics, and their runs.

`generation` plans, computes and checks rows, `database` keeps them, `maps` reads surfaces of
instruments, `law` tabulates their contacts, `runtime` is what every command of the project runs on.
"""
