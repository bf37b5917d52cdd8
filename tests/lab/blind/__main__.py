"""`make blind`: hide effects, let the diagnosis find them, print what it found as Markdown.

SEED=  other campaigns, several with commas       SIZE=   small, full, or a share of the full table
ONLY=  rows whose names begin with these          PROCESSES= how many at once (2)
ARGS="--scheduler WHERE": local, processes[:N], or tcp://host:port of a Dask scheduler whose workers can import these tests
ARGS=--write puts the table into docs/appendix/diagnosis.md, ARGS=--failures lists what went wrong with its command

Outcomes are stored in .blind/table, a file each: the next run goes on where this one ended. After a change of code
remove them.
"""

import sys
from collections.abc import Sequence

from tests.lab.blind import table
from tests.lab.blind.rows import asked_for
from tests.lab.blind.trials import Outcome, stored
from tests.lab.measuring import Asked, each, publish, where


def document(outcomes: Sequence[Outcome], command: str) -> list[str]:
    """All tables, with the command that makes them; what could not be made is stated and counts nowhere."""
    made = [one for one in outcomes if one.made]
    parts = [
        [f"`{command}`"],
        table.unmade(outcomes),
        table.summary(made),
        table.by_effect(made),
        table.by_loudness(made),
        table.outside(made),
        table.reliability(made),
        table.of_gains(),
        table.gains(made),
        table.speed(made),
    ]
    return [line for part in parts if len(part) != 2 or not part[0].startswith("|") for line in (*part, "")]


def main() -> None:
    """Print the table."""
    asked = Asked.here()
    outcomes = list(each(stored, asked_for(asked), where(2)))
    publish("diagnosis.md", "blind", document(outcomes, f"make blind {asked}"))
    if "--failures" in sys.argv:
        print("\n".join(table.failures(outcomes)))


if __name__ == "__main__":
    main()
