"""The parts of the page, in its order. Names of commands that users type stand here once more."""

from bench.page.part import Part, contents_of

SOLVER = "The contact solver: error against run time"
STABILITY = "Stiff and extreme cases"
FARM = "The farm"
SURROGATES = "Surrogates: what they are worth, and what they cost"
PAPER = "The paper, side by side"
BENCHMARKS = "Benchmarks"

ROWS = 1500
"""Rows of the paper preset that a short run generates; a full one generates all 15,878."""

PARTS = (
    Part(
        "solver",
        SOLVER,
        "Work and precision",
        quick="-m bench solver --quick -o {folder}",
        full="-m bench solver -o {folder}",
        show=contents_of("bench.work_precision.report:contents"),
    ),
    Part(
        "peers",
        SOLVER,
        "Other solvers, and the paper's algorithm",
        quick="-m bench peers --nodes 129 --deltas 5,15,25 --rounds 2 -o {folder}",
        full="-m bench peers --nodes 129,257,513 --deltas 5,15,25,35,45 --rounds 2 -o {folder}",
        show=contents_of("bench.peers.report:contents"),
    ),
    Part(
        "growth",
        SOLVER,
        "Growth with the grid",
        quick="-m bench growth --nodes 129,257,513 --surfaces 1 -o {folder}",
        full="-m bench growth --nodes 129,257,513,1025,2049 --surfaces 3 -o {folder}",
        show=contents_of("bench.growth:contents"),
    ),
    Part(
        "hertz",
        SOLVER,
        "Hertz",
        quick="-m bench hertz -o {folder}",
        full="-m bench hertz -o {folder}",
        show=contents_of("bench.hertz:contents"),
    ),
    Part(
        "theory",
        SOLVER,
        "Theories of random contact",
        quick="-m bench theory --nodes 256 --surfaces 1 -o {folder}",
        full="-m bench theory -o {folder}",
        show=contents_of("bench.theory:contents"),
    ),
    Part(
        "stability",
        STABILITY,
        "Generators, statistics, solver, models",
        quick="-m bench stability -o {folder}",
        full="-m bench stability --full -o {folder}",
        show=contents_of("bench.stability.tables:contents"),
        judges=True,
    ),
    Part(
        "scale",
        FARM,
        "Many ranks, simulated",
        quick="",
        full="-m bench scale --validate -o {folder}",
        show=contents_of("bench.scale.report:contents"),
    ),
    Part(
        "comparison",
        SURROGATES,
        "Nine models",
        quick="-m learn compare {database} --area-max 16.56 -o {folder}",
        full="-m learn compare {database} --area-max 16.56 -o {folder}",
        show=contents_of("bench.page.comparison:scores"),
    ),
    Part(
        "tuning",
        SURROGATES,
        "The search for settings",
        quick="",
        full="-m learn tune {database} --area-max 16.56 --budget 2h -o {comparison}",
        show=contents_of("bench.page.comparison:searches"),
        folder="comparison",
    ),
    Part(
        "grids",
        SURROGATES,
        "What the search over whole grids takes",
        quick="",
        full="-m learn estimate {database} --area-max 16.56 --budget 1h -o {comparison}",
        show=contents_of("bench.page.comparison:whole_grids"),
        folder="comparison",
    ),
    Part(
        "models",
        SURROGATES,
        "Error against the time of prediction, fit and search",
        quick="-m bench models {comparison} -o {folder}",
        full="-m bench models {comparison} -o {folder}",
        show=contents_of("bench.surrogates.models:contents"),
    ),
    Part(
        "tolerance",
        SURROGATES,
        "What the solver's tolerance does to a surrogate",
        quick="-m bench tolerance --rows 400 -o {folder}",
        full="-m bench tolerance --rows 4000 -o {folder}",
        show=contents_of("bench.surrogates.tolerance_report:contents"),
    ),
    Part(
        "generalisation",
        SURROGATES,
        "Where surrogates were not trained",
        quick="-m bench generalisation --rows 600 --database {database} -o {folder}",
        full="-m bench generalisation --database {database} -o {folder}",
        show=contents_of("bench.surrogates.generalisation_report:contents"),
    ),
    Part(
        "cost",
        SURROGATES,
        "Total cost, and from where on a surrogate pays",
        quick="-m bench cost --rows 1000 --database {database} -o {folder}",
        full="-m bench cost --database {database} -o {folder}",
        show=contents_of("bench.surrogates.cost_report:contents"),
    ),
    Part(
        "throughput",
        SURROGATES,
        "Time of one contact",
        quick="-m bench throughput --rows 500 --database {database} -o {folder}",
        full="-m bench throughput --database {database} -o {folder}",
        show=contents_of("bench.surrogates.throughput:contents"),
    ),
    Part(
        "memory",
        SURROGATES,
        "Memory of fits",
        quick="",
        full="-m bench memory -o {folder}",
        show=contents_of("bench.memory:contents"),
    ),
    Part(
        "paper",
        PAPER,
        "Figures and tables",
        quick="-m bench paper --database {database} [--comparison {comparison}] [--cost {cost}]"
        " -o {folder}",
        full="-m bench paper --database {database} [--comparison {comparison}] [--cost {cost}]"
        " [--fine {fine}] -o {folder}",
        show=contents_of("bench.paper.report:contents"),
    ),
    Part(
        "unstated",
        PAPER,
        "What the paper does not say, and what it does to the result",
        quick="",
        full="-m bench unstated --rows 3000 -o {folder}",
        show=contents_of("bench.paper.unstated.report:contents"),
    ),
    Part(
        "benchmarks",
        BENCHMARKS,
        "Times of single steps",
        quick="-m pytest bench --benchmark-only -q -k smoke --benchmark-json {folder}/times.json",
        full="-m pytest bench --benchmark-only -q --benchmark-json {folder}/times.json",
        show=contents_of("bench.benchmarks:contents"),
        judges=True,
    ),
)
