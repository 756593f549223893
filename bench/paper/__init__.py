"""The paper, side by side: its tables and figures beside ours, one function for each of them.

`report` makes all of them for the command `asperity bench paper`:

- `surfaces` draws the generator, the statistics, two pressed topographies and Appendix A;
- `database` has the solve times, Table 1, and the finer grid of section 4.3 with Table 5;
- `models` has Tables 2 to 4 with their pictures, and the numbers in the paper's text.

Tables 2 to 4 need a folder of `learn compare` and `learn tune`, which `learn.comparison` writes.
`facts` has the paper's numbers that no other module needs. `docs/results/models.md` leads from each
table and figure of the paper to its command and its function.
"""
