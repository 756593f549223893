"""Growth of a database and its surrogate until the surrogate is accurate enough.

`rounds` is the loop with its report: rows of a scene are generated, and a surrogate is fitted to
them and judged. `accuracy` estimates the errors from rows that are held out, and the number of rows
that is needed from a learning curve.
"""
