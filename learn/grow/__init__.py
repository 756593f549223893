"""Growth of a database and its surrogate until the surrogate is as accurate as asked for.

`rounds` is the loop: rows are generated (`generation`), some of them are held out for tests
(`holdout`), a surrogate is fitted and judged (`appraisal`, `accuracy`), and its learning curve
(`curve`) says how many rows the next round needs.
"""
