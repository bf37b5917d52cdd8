"""`clutchlife score`: how accurate the predictions were, for every clutch that has reached its threshold."""

from typing import Annotated, Any

import typer

from service.cli.options import DATABASE, EX_USAGE, Database, fail, out, read_only


def score(
    method: Annotated[str, typer.Option(help="particle, ukf or grid")] = "particle", database: Database = DATABASE
) -> None:
    """Score the prediction at every test of every life that has ended."""
    from service.lives.tracks import METHODS  # start-up time
    from service.queries import scores  # start-up time
    from storage import clutches  # start-up time

    if method not in METHODS:
        fail(f"method must be one of {', '.join(METHODS)}, got {method!r}", EX_USAGE)
    with read_only(database) as opened:
        with opened.reading() as connection:
            clutch_ids = clutches.all_ids(connection)
        fleet = scores.of_fleet((scores.of_clutch(opened, name, method) for name in clutch_ids), method=method)
    for life in fleet["lives"]:
        out.print(f"{life['clutch_id']}: ended at {life['end_of_life_cycles']:.0f} cycles", markup=False)
    if not fleet["lives"]:
        out.print("no clutch has reached its threshold yet: there is nothing to score", markup=False)
        return
    out.print("share of life  predictions  CRPS/life  interval/life  coverage  alpha-lambda", markup=False)
    for row in [*fleet["stages"], fleet["overall"]]:
        out.print(_line(row), markup=False)


def _line(row: dict[str, Any]) -> str:
    stage = f"{row['share_of_life']:.1f}" if "share_of_life" in row else "all"
    shares = (row[name] for name in ("crps_share", "interval_share", "coverage", "alpha_lambda"))
    columns = ["-" if value is None else f"{value:.3f}" for value in shares]
    return (
        f"{stage:>13}  {row['predictions']:>11}  {columns[0]:>9}  {columns[1]:>13}  {columns[2]:>8}  {columns[3]:>12}"
    )
