"""`gen run`, `gen estimate`: generate a database, or tell what it will take."""

from gen import options
from gen.runtime import farm, signals
from gen.runtime.errors import InputError
from gen.runtime.numbers import rows_from


def run(
    scene: options.Scene,
    output: options.NewDatabase,
    rows: options.Rows = "",
    retry_failed: options.RetryFailed = False,
    force: options.Force = False,
    sample_limit: options.SampleLimit = None,
    writer: options.Writer = "auto",
    dry_run: options.DryRun = False,
    trust: options.Trust = False,
) -> int:
    """Generate a database, or continue an interrupted run.

    A single process works serially. Under `mpiexec -n 9 python -m mpi4py -m gen run ...` rank 0
    hands out the samples and 8 workers compute them. An interrupted run finishes the samples that
    it has begun; the same command continues it.
    """
    world = farm.this_world()
    share = rows_from(rows)
    if sample_limit is not None and not 0 < sample_limit <= signals.LONGEST:
        raise InputError(
            f"--sample-limit {sample_limit:g}: give seconds, a number above 0, at most"
            f" {signals.LONGEST:g}"
        )
    if dry_run:
        if world.is_master:
            from gen.display import databases
            from gen.generation.forecast import plan_of
            from gen.generation.functions import completed
            from gen.scene import load

            databases.print_plan(plan_of(completed(load(scene))), output)
        return 0
    from gen.generation.run import Request, generate_database

    request = Request(scene, output, share, retry_failed, force, sample_limit, writer)
    result = generate_database(request, world)
    if world.is_master:
        from gen.display import databases

        databases.print_result(output, result)
    return 128 + result.signal if result.signal and result.counts.pending else 0


def estimate(
    scene: options.SceneName,
    ranks: options.Ranks = 1,
    trust: options.Trust = False,
) -> None:
    """Measure a few samples and predict time, memory and disk space of a run."""
    from gen.display import databases
    from gen.generation import forecast
    from gen.generation.functions import completed
    from gen.scene import load

    loaded = completed(load(scene))
    databases.print_estimate(forecast.plan_of(loaded), forecast.estimate(loaded, ranks))
