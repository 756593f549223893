"""Growth of a database and its surrogate until the surrogate is as accurate as asked for.

`rounds` is the loop, and the report of its end: rows of a scene are generated, a surrogate is
fitted and judged on those held out, with a learning curve that says how many rows are needed
(`accuracy`).
"""
