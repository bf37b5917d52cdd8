"""`clutchlife score`: how right the predictions were of every clutch that has reached its threshold."""

from typing import Annotated, Any

import typer

from service.cli.options import DATABASE, EX_USAGE, Database, existing, fail, out


def score(
    method: Annotated[str, typer.Option(help="particle, ukf or grid")] = "particle", database: Database = DATABASE
) -> None:
    """Back-cast every life that came to its end: what would have been said at each test, and how right it was."""
    from service.lives.tracks import METHODS
    from service.queries import scores  # loaded by the one command that needs it
    from service.queries.cache import AnswerCache
    from service.web.limits import MOST_CACHED_BYTES

    if method not in METHODS:
        fail(f"method must be one of {', '.join(METHODS)}, got {method!r}", EX_USAGE)
    with existing(database) as opened:
        said = scores.of_fleet(opened, AnswerCache(MOST_CACHED_BYTES), method=method)
    for life in said["lives"]:
        out.print(f"{life['clutch_id']}: ended at {life['end_of_life_cycles']:.0f} cycles", markup=False)
    if not said["lives"]:
        out.print("no clutch has reached its threshold yet: there is nothing to score", markup=False)
        return
    out.print("share of life  predictions  CRPS/life  interval/life  coverage  alpha-lambda", markup=False)
    for row in [*said["stages"], said["overall"]]:
        out.print(_line(row), markup=False)


def _line(row: dict[str, Any]) -> str:
    stage = f"{row['share_of_life']:.1f}" if "share_of_life" in row else "all"
    shares = (row[name] for name in ("crps_share", "interval_share", "coverage", "alpha_lambda"))
    told = ["-" if value is None else f"{value:.3f}" for value in shares]
    return f"{stage:>13}  {row['predictions']:>11}  {told[0]:>9}  {told[1]:>13}  {told[2]:>8}  {told[3]:>12}"
