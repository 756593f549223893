"""`gen info`, `plot`, `columns`, `check`, `merge`, `export`: commands that read databases."""

from gen import options
from gen.runtime.files import Output, check_outputs
from gen.runtime.terminal import echo


def info(file: options.Database) -> None:
    """Summarise a database: rows, ranges, times, scene, versions."""
    from gen.database import Reader
    from gen.display import databases

    with Reader(file) as reader:
        databases.print_database(reader)


def plot(
    file: options.Database,
    output: options.NewPicture,
    trust: options.Trust = False,
) -> None:
    """Draw a database: one surface and its pressure, all areas, all solve times."""
    from gen.display.picture import draw_database

    check_outputs([Output(output, "--output", "picture")], [file])
    draw_database(file, output)
    echo(f"wrote {output}")


def columns() -> None:
    """Print the columns of a database as a table in Markdown."""
    from gen.scene.columns import markdown_table

    for line in markdown_table().splitlines():
        echo(line)


def check(
    file: options.Database,
    recompute: options.Recompute = 16,
    seed: options.Seed = 0,
    trust: options.Trust = False,
) -> int:
    """Check a database: statuses, values and plan, and recompute N random rows.

    The exit code is 0 if everything is right, 1 if not.
    """
    from gen.database import Reader
    from gen.generation.check import faults

    count = 0
    for fault in faults(file, recompute, seed):
        count += 1
        echo(f"{file}: {fault}")
    if not count:
        with Reader(file) as reader:
            pending, done, failed = reader.counts()
        again = min(recompute, done + failed)
        echo(
            f"{file}: sound; {done} rows done, {failed} failed, {pending} pending; {again} of them"
            " computed again, equal bit for bit"
        )
    return 1 if count else 0


def merge(
    files: options.Databases,
    output: options.NewDatabase,
) -> None:
    """Join databases with rows of one scene that different jobs computed."""
    from gen import database

    pending, done, failed = database.merge(output, files)
    echo(f"{output}: {done} rows done, {failed} failed, {pending} pending")


def export(
    file: options.Database,
    output: options.ExportFolder,
    title: options.Title = "",
    creator: options.Creator = "",
    licence: options.Licence = "",
    doi: options.Doi = "",
) -> None:
    """Write a database as Parquet files with a data card and Croissant's description.

    The same command continues an interrupted export, and renews one of a database that has grown.
    """
    from gen.database import Reader
    from gen.export import export as export_to
    from gen.export.description import About
    from gen.runtime.memory import size

    with Reader(file) as reader:
        about = About.of(reader, title, creator, licence, doi)
        exported = export_to(reader, output, about)
    left_out = f"; {exported.left_out} failed or pending" if exported.left_out else ""
    echo(f"{output}: {exported.rows} rows{left_out}, {size(exported.size_bytes)}")
