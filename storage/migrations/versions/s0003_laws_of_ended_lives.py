"""Ended lives of a fleet's prior state how probably they followed each course of the filters (`laws`).

Of those that are stored it is not known: 0, until the fleet is learned again.
"""

import json

import sqlalchemy as sa
from alembic import op

revision = "s0003_laws_of_ended_lives"
down_revision: str | None = "s0001_first_tables"

_prior = sa.table("fleet_prior", *map(sa.column, ("fleet", "version", "left_out", "content")))
_own = (
    _prior.c.fleet == sa.bindparam("f"),
    _prior.c.version == sa.bindparam("v"),
    _prior.c.left_out == sa.bindparam("o"),
)
_set = sa.update(_prior).where(*_own).values(content=sa.bindparam("c"))


def upgrade() -> None:
    """Add them to every life."""
    connection = op.get_bind()
    for fleet, version, left_out, stored in connection.execute(sa.select(_prior)).fetchall():
        content = json.loads(stored)
        for life in (*content.get("ended", ()), *content.get("censored", ())):
            life.setdefault("laws", [0.0] * 6)
        text = json.dumps(content, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
        connection.execute(_set, {"f": fleet, "v": version, "o": left_out, "c": text})
