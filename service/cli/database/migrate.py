"""`clutchlife migrate`: everything that one database holds, in another."""

from typing import Annotated

import typer

from service.cli.options import err, errors_in_a_line, fail, print_line, require_database


def migrate(
    source: Annotated[str, typer.Option("--from", help="The database that is copied, and stays as it is")],
    target: Annotated[str, typer.Option("--to", help="An empty database, or a file that is yet to be made")],
) -> None:
    """Copy a database into another, SQLite's or PostgreSQL's, and compare all of it; no service may run on either.

    Interrupted, it goes on where it was when the command is given again. The target is used by no service until all tables
    are the same on both sides, and every run is as it was sent.
    """
    from service.queries.verification import (  # start-up time
        check_inspections,  # start-up time
        check_runs,  # start-up time
    )
    from service.work.progress import progress  # start-up time
    from storage import clutches  # start-up time
    from storage.transfer.transfer import transfer  # start-up time

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
                    findings += check_runs(moving.target, clutch_id).findings
                    findings += check_inspections(moving.target, clutch_id).findings
                    advance()
            for finding in findings:
                print_line(finding)
            if findings:
                fail(f"{len(findings)} findings: the target is not used. Remove it, and migrate again")
            moving.release()
    print_line(f"{rows} rows of {len(ids)} clutches are the same in both databases")
