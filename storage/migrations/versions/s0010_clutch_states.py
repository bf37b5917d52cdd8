"""What lists of clutches are filtered, counted and searched by: columns, and indexes that lead to them."""

import json

import sqlalchemy as sa
from alembic import op

from storage.dialects import TEXT, json_fields, json_text

revision = "s0010_clutch_states"
down_revision: str | None = "s0009_raw_stores"

_clutch = sa.table(
    "clutch", *(sa.column(name) for name in ("clutch_id", "record", "summary", "state", "disputed", "searched"))
)
_run = sa.table(
    "run",
    *(sa.column(name) for name in ("clutch_id", "run_id", "cycles", "started_at", "received_at", "details", "state")),
)
_diagnosis = sa.table(
    "diagnosis",
    *(sa.column(name) for name in ("diagnosis_key", "clutch_id", "diagnosis_id", "status", "life", "report")),
)
_adopted = sa.table("adopted_model", *(sa.column(name) for name in ("clutch_id", "version", "diagnosis_id")))
_DISAGREES = {"cause_named", "cause_ambiguous", "unexplained_structure"}


def upgrade() -> None:
    """Make columns and indexes, and fill them: the states are those that pages have computed so far."""
    op.add_column("clutch", sa.Column("state", TEXT, nullable=False, server_default="check"))
    op.add_column("clutch", sa.Column("disputed", TEXT))
    op.add_column("clutch", sa.Column("searched", TEXT, nullable=False, server_default=sa.text("''")))
    op.drop_index("clutch_worst_first", "clutch")
    connection = op.get_bind()
    disputed, rebuilds = _disputes(connection), _rebuilds(connection)
    rows = [
        {
            "wanted": clutch_id,
            "new_state": _state(json.loads(summary), disputed.get(clutch_id), rebuilds.get(clutch_id, "")),
            "new_disputed": disputed.get(clutch_id),
            "new_searched": _searched(clutch_id, json.loads(record)),
        }
        for clutch_id, record, summary in connection.execute(
            sa.select(_clutch.c.clutch_id, _clutch.c.record, _clutch.c.summary)
        )
    ]
    fill = (
        sa.update(_clutch)
        .where(_clutch.c.clutch_id == sa.bindparam("wanted"))
        .values({name: sa.bindparam(f"new_{name}", type_=TEXT) for name in ("state", "disputed", "searched")})
    )
    if rows:
        connection.execute(fill, rows)
    op.create_index("clutch_worst_first", "clutch", ["archived", "rank", "clutch_id"])
    op.create_index("clutch_by_state", "clutch", ["archived", "state", "rank", "clutch_id"])


def _disputes(connection: sa.Connection) -> dict[str, str]:
    """clutch_id -> the life of its newest finished diagnosis, where that disagrees and its model is not adopted."""
    versions = sa.select(_adopted.c.clutch_id, _adopted.c.diagnosis_id).order_by(_adopted.c.version)
    in_force = {row.clutch_id: row.diagnosis_id for row in connection.execute(versions)}
    finished = (
        sa.select(
            _diagnosis.c.clutch_id,
            _diagnosis.c.diagnosis_id,
            _diagnosis.c.life,
            json_fields(_diagnosis.c.report, "verdict"),
        )
        .where(_diagnosis.c.status == "finished")
        .order_by(_diagnosis.c.diagnosis_key)
    )
    newest = {clutch_id: diagnosed for clutch_id, *diagnosed in connection.execute(finished)}
    return {
        clutch_id: life
        for clutch_id, (diagnosis_id, life, short) in newest.items()
        if json.loads(short)["verdict"] in _DISAGREES and in_force.get(clutch_id) != diagnosis_id
    }


def _rebuilds(connection: sa.Connection) -> dict[str, str]:
    """clutch_id -> the rebuild that began its present life: summaries of the first releases do not say it."""
    rebuilds = (
        sa.select(_run.c.clutch_id, _run.c.run_id)
        .where(json_text(_run.c.details, "event") == "rebuild", _run.c.state == "accepted")
        .order_by(_run.c.cycles, sa.func.coalesce(_run.c.started_at, _run.c.received_at))
    )
    return {row.clutch_id: row.run_id for row in connection.execute(rebuilds)}


def _state(summary: dict[str, object], disputed: str | None, rebuild: str) -> str:
    status = summary.get("status", "insufficient_data")
    if status == "insufficient_data":
        return "check"
    if status == "reached":
        return "failure"
    if disputed is not None and disputed == summary.get("life", rebuild):
        return "out_of_specification"
    current = summary["current"]
    health = current["health"] if isinstance(current, dict) else None
    return "maintenance" if health is not None and health < 0.2 else "normal"


def _searched(clutch_id: str, record: dict[str, str]) -> str:
    return "\n".join([clutch_id, record.get("friction_material", ""), record.get("fluid", "")]).casefold()
