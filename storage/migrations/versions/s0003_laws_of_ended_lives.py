"""Ended lives of a fleet's prior state how probably they followed each course of the filters (`laws`, for `lawful`).

Of those that are stored only the first, eq. 6, is known: the others are 0 until the fleet is learned again.
"""

import json

import sqlalchemy as sa
from alembic import op

revision = "s0003_laws_of_ended_lives"
down_revision: str | None = "s0002_lawful_lives"

_prior = sa.table("fleet_prior", *map(sa.column, ("fleet", "version", "left_out", "content")))
_own = (
    _prior.c.fleet == sa.bindparam("f"),
    _prior.c.version == sa.bindparam("v"),
    _prior.c.left_out == sa.bindparam("o"),
)
_set = sa.update(_prior).where(*_own).values(content=sa.bindparam("c"))


def upgrade() -> None:
    """Put it in the place of the former."""
    connection = op.get_bind()
    for fleet, version, left_out, stored in connection.execute(sa.select(_prior)).fetchall():
        content = json.loads(stored)
        for life in (*content.get("ended", ()), *content.get("censored", ())):
            life["laws"] = [life.pop("lawful"), *[0.0] * 5]
        text = json.dumps(content, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
        connection.execute(_set, {"f": fleet, "v": version, "o": left_out, "c": text})
