"""The paper's numbers that nothing else in this tree needs, and where all of them stand.

Its ranges (Table 1) stand in `gen.schema`, its search spaces and optima (Table 2) in
`learn.comparison.spaces`, its times and scores (Tables 3 and 4) in
`learn.comparison.paper`, its costs (section 4.4) in `bench.surrogates.times`, its paraboloid
(section 2.4) in `bench.hertz`: modules here take them from there.
"""

from bench.surrogates.times import PAPER_ROWS, PAPER_TESTS
from gen.scene.columns import ALL_COLUMNS
from learn.metrics import Scores

GRIDS = (2, 8, 32, 128)  # cells a side of the surfaces that show how the generator works
DELTAS = (25.0, 35.0)  # displacements at which two topographies are pressed (section 2.4) [um]
LONGEST_SOLVE = 1750.0  # time that a simulation takes at most, approximately (section 2.4) [s]
TRAIN_ROWS = PAPER_ROWS - PAPER_TESTS  # rows that train (section 3.2)
FINE_ROWS = 800  # simulations on the finer grid (section 4.3)
FINE = Scores(1.46, 3.95, 7.56, 99.16)  # scores of kernel ridge on the finer grid, Table 5 [%]
TUNING_PAYS = 14  # evaluations after which the search for settings has paid (section 4.4)
# Smallest and largest value of each quantity of Table 1.
RANGES = {column.name: column.paper_range for column in ALL_COLUMNS if column.paper_range}
AREA_MAX = RANGES["area_percent"][1]  # largest area in the paper's database [%]
