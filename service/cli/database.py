"""Commands on the database itself, for the machine that holds it: a backup, the results computed again, and the like."""

import random
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress

from service.cli.options import (
    DATABASE,
    Database,
    Scheduler,
    err,
    errors_in_a_line,
    executor,
    existing,
    fail,
    print_line,
    require_database,
    require_file,
    say,
)
from storage.engine.errors import DatabaseTooOld


def backup(path: Path, database: Database = DATABASE) -> None:
    """Make a consistent copy of the database, also while the service runs."""
    from storage.engine.sqlite.database import back_up  # start-up time

    with errors_in_a_line():
        require_file(database, "back it up with pg_dump --format=custom")
        require_database(database)
        back_up(database, path)
        left_out = _left_out(path)
    print_line(str(path))
    for address, blobs in left_out.items():
        say(f"the backup does not contain {blobs} raw records: copy them now from {address}")


def _left_out(path: Path) -> dict[str, int]:
    """The number of blobs that the copy names, by store; an earlier revision names none."""
    from storage.blobs import raw_stores  # start-up time
    from storage.engine.opening import find_database  # start-up time

    with closing(find_database(f"sqlite:///{path.absolute()}")) as copied:
        try:
            with copied.reading() as connection:
                return {address: blobs for address, (_, blobs) in raw_stores.numbers(connection).items()}
        except DatabaseTooOld:
            return {}


def restore(
    backup: Annotated[Path, typer.Argument(metavar="BACKUP", help="A backup, made by clutchlife backup")],
    database: Database = DATABASE,
) -> None:
    """Replace the database by the file BACKUP. The old database stays beside it as FILE-replaced.

    Stop the service first. The next start migrates a backup of an earlier release.
    """
    from storage.engine.sqlite.backup import restore as put_back  # start-up time

    with errors_in_a_line():
        require_file(database, "stop the service, then restore a dump with pg_restore")
        replaced_file = put_back(database, backup)
    print_line(f"{database} now holds the backup {backup}")
    if replaced_file is not None:
        print_line(f"the old database is kept as {replaced_file}")


def replay(
    clutch_ids_given: Annotated[
        list[str] | None, typer.Argument(metavar="[ID...]", help="The clutches; default: all")
    ] = None,
    database: Database = DATABASE,
    scheduler: Scheduler = "local",
) -> None:
    """Compute all results again from the raw runs, with the installed code.

    A clutch with a run that this code cannot evaluate keeps its results; the command goes on with the others.
    """
    from service.changes import replay as change  # start-up time
    from service.jobs.progress import progress  # start-up time: only this command needs it

    left = []
    with existing(database) as opened, executor(scheduler) as computing, progress(err, "replaying") as advance:
        clutch_ids = clutch_ids_given or change.clutch_ids(opened)
        advance(0, total=len(clutch_ids))
        for replayed in change.replay(opened, clutch_ids, computing):
            if replayed.error is not None:
                left.append(replayed.name)
                say(f"{replayed.name}: not replayed: {replayed.error}")
            elif replayed.result is not None:
                print_line(f"{replayed.name}: {len(replayed.result.receipts)} runs")
            advance()
    if left:
        fail(f"{len(left)} clutches keep their previous results: {', '.join(left)}")


def verify(
    database: Database = DATABASE,
    sample: Annotated[
        int | None, typer.Option(min=0, help="Recompute only this many clutches, chosen at random; default: all")
    ] = None,
) -> None:
    """Check the database: its pages and schema, every row's checksum, the hash of every run, inspection and photograph, and
    all results.

    Prints one line for each fault, and ends with 1 if there is any. Works beside a running service and on a backup.
    """
    from service.answers import verification  # start-up time
    from service.jobs.background import use_one_blas_thread  # start-up time
    from storage import clutches  # start-up time
    from storage.engine.integrity import other_schema  # start-up time

    use_one_blas_thread()
    findings = runs = inspections = photographs = recomputed = 0
    earlier: Counter[str] = Counter()

    def tell(lines: Sequence[str]) -> int:
        for line in lines:
            print_line(line)
        return len(lines)

    with existing(database, read_only=True) as opened, Progress(console=err, transient=True) as progress:
        with opened.reading() as connection:
            damaged = tell(opened.damage(connection))
            if damaged:  # what is read of a damaged file is not to be trusted: neither runs nor what follows from them
                fail(f"{damaged} findings: the file is damaged. Restore a backup: clutchlife restore BACKUP")
            findings += tell(other_schema(connection))
            ids = clutches.all_ids(connection)
        findings += tell(verification.check_other_rows(opened).findings)
        chosen = set(ids if sample is None else random.sample(ids, min(sample, len(ids))))
        task = progress.add_task("verifying", total=len(ids))
        for clutch_id in ids:
            checked = verification.check(opened, clutch_id, recompute=clutch_id in chosen)
            findings += tell(checked.findings)
            runs, inspections = runs + checked.runs, inspections + checked.inspections
            photographs, recomputed = photographs + checked.photographs, recomputed + checked.recomputed
            earlier.update(checked.earlier)
            progress.advance(task)
    for version, count in sorted(earlier.items()):
        print_line(
            f"{count} results were computed by release {version}: a replay computes them again and may change them"
        )
    if inspections:
        print_line(f"{inspections} inspections with {photographs} photographs were checked")
    checked_runs = f"{runs} runs of {len(ids)} clutches were checked"
    summary = f"{checked_runs}, {recomputed} of the clutches computed again: {findings} findings"
    if findings:
        fail(summary)
    print_line(summary)


def migrate(
    source: Annotated[str, typer.Option("--from", help="The database to copy; it stays unchanged")],
    target: Annotated[str, typer.Option("--to", help="An empty database, or a file that does not exist yet")],
) -> None:
    """Copy a database into another (SQLite or PostgreSQL), and compare the two. Stop all services of both first.

    If it was interrupted, repeat the command: it goes on where it stopped. No service uses the target until all tables
    are the same on both sides.
    """
    from service.answers import verification  # start-up time
    from service.jobs.progress import progress  # start-up time
    from storage import clutches  # start-up time
    from storage.transfer import transfer  # start-up time

    with errors_in_a_line():
        require_database(source)
        with transfer(source, target) as moving:
            rows = moving.rows()
            with progress(err, "copying rows") as advance:
                advance(0, total=rows)
                moving.copy(lambda _, count: advance(count))
            with progress(err, "comparing rows") as advance:
                advance(0, total=rows)
                findings = moving.differing(lambda _, count: advance(count))
            with moving.target.reading() as connection:
                ids = clutches.all_ids(connection)
            with progress(err, "checking clutches") as advance:
                advance(0, total=len(ids))
                for clutch_id in ids:
                    findings += verification.check(moving.target, clutch_id, recompute=False).findings
                    advance()
            for finding in findings:
                print_line(finding)
            if findings:
                fail(f"{len(findings)} findings: do not use the target. Delete it, and migrate again")
            moving.release()
    print_line(f"{rows} rows of {len(ids)} clutches are the same in both databases")


app = typer.Typer(help="Where long raw records are kept beside the database.", no_args_is_help=True)

Address = Annotated[str, typer.Option("--to", help="database, folder:///path or s3://bucket/prefix")]


@app.command("list")
def list_stores(database: Database = DATABASE) -> None:
    """List the stores of long raw records: how much each one holds, and which one takes new records."""
    from storage.blobs import raw_stores  # start-up time

    with existing(database) as opened, opened.reading() as connection:
        stores, numbers = raw_stores.all_of(connection), raw_stores.numbers(connection)
    for store in stores:
        columns, blobs = numbers.get(store.address, (0, 0))
        print_line(f"{store.address}: {columns} channels in {blobs} files{', in use' if store.in_use else ''}")
    if not any(store.in_use for store in stores):
        print_line("new raw records go into the database")


@app.command()
def move(to: Address, database: Database = DATABASE) -> None:
    """Store new long raw records at another address, and move the stored records there.

    The service may run meanwhile. You may interrupt the command and repeat it. `collect` then removes the old copies.
    """
    from service.changes.raw_records import move as move_all  # start-up time

    with existing(database) as opened, Progress(console=err, transient=True) as progress:
        task = progress.add_task("moving channels", total=None)
        moved = move_all(opened, to, tell=lambda count: progress.update(task, completed=count))
    print_line(f"{moved} channels were moved")


@app.command()
def relocate(
    address: Annotated[str, typer.Argument(help="The old address, as `list` shows it")],
    to: Address,
    database: Database = DATABASE,
) -> None:
    """Change the address of a store, after you have copied the whole store to the new address.

    If a run arrives meanwhile, the service refuses the run or this command fails: then copy again and repeat.
    """
    from service.changes.raw_records import relocate as look_at  # start-up time

    with existing(database) as opened:
        count = look_at(opened, address, to)
    print_line(f"{count} raw records are now read from {to}")


@app.command()
def collect(
    database: Database = DATABASE,
    # no run takes longer than a day from its arrival to its commit, nor do the clocks of a store and of this machine differ
    # by more; at least what a single run may take
    grace_hours: Annotated[
        float, typer.Option(min=1.0, help="Keep files that are younger than this many hours")
    ] = 24.0,
) -> None:
    """Remove files of raw records that no run uses, as interrupted requests leave them. Safe while services run."""
    from service.changes.raw_records import collect as collect_all  # start-up time

    with existing(database) as opened:
        for store in collect_all(opened, grace=grace_hours * 3600.0):
            print_line(
                f"{store.address}: {store.named} files in use, {store.removed} removed, {store.new} too new to be removed"
            )
