"""`clutchlife verify`: what is stored, held against itself; nothing is changed."""

import random
from typing import Annotated

import typer
from rich.progress import Progress

from service.cli.options import DATABASE, Database, err, fail, print_line, read_only


def verify(
    database: Database = DATABASE,
    sample: Annotated[
        int | None, typer.Option(min=0, help="Recompute this many clutches only, drawn again each time; left out, all")
    ] = None,
) -> None:
    """Check pages, references and schema, the hashes of every run, inspection and photograph, and that all results follow.

    Prints what is wrong, a line each; ends with 1 where anything is. Also while the service runs, and for a backup.
    """
    from service.queries.verification import (  # start-up time
        check_inspections,  # start-up time
        check_results,  # start-up time
        check_runs,  # start-up time
    )
    from service.work.background import use_one_blas_thread  # start-up time
    from storage import clutches  # start-up time
    from storage.engine.integrity import other_schema  # start-up time

    use_one_blas_thread()
    findings = runs = inspections = photographs = 0
    earlier: dict[str, int] = {}

    def tell(lines: "list[str] | tuple[str, ...]") -> int:
        for line in lines:
            print_line(line)
        return len(lines)

    with read_only(database) as opened, Progress(console=err, transient=True) as progress:
        with opened.reading() as connection:
            damaged = tell(opened.damage(connection))
            if damaged:  # what is read of a damaged file is not to be trusted: neither runs nor what follows from them
                fail(f"{damaged} findings: the file is damaged. Put a backup back: clutchlife restore BACKUP")
            findings += tell(other_schema(connection))
            ids = clutches.all_ids(connection)
        chosen = set(ids if sample is None else random.sample(ids, min(sample, len(ids))))
        task = progress.add_task("verifying", total=len(ids))
        for clutch_id in ids:
            content = check_runs(opened, clutch_id)
            runs += content.runs
            surfaces = check_inspections(opened, clutch_id)
            inspections, photographs = inspections + surfaces.inspections, photographs + surfaces.photographs
            findings += tell(content.findings) + tell(surfaces.findings)
            if clutch_id in chosen and not content.findings:
                results = check_results(opened, clutch_id)
                findings += tell(results.findings)
                for version, count in results.earlier.items():
                    earlier[version] = earlier.get(version, 0) + count
            progress.advance(task)
    for version, count in sorted(earlier.items()):
        note = f"{count} results were made by release {version}: they can be computed again, and may differ (replay)"
        print_line(note)
    if inspections:
        print_line(f"{inspections} inspections with {photographs} photographs are checked")
    summary = (
        f"{runs} runs of {len(ids)} clutches are checked, {len(chosen)} clutches computed again: {findings} findings"
    )
    if findings:
        fail(summary)
    print_line(summary)
