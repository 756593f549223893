"""Growth of a database and its surrogate until the surrogate is as accurate as asked for.

`rounds` is the loop: rows of a scene are generated (`rows`), a surrogate is fitted and judged on
those held out (`accuracy`), and its learning curve (`curve`) says how many rows the next round
needs. `report` tells the end.
"""
