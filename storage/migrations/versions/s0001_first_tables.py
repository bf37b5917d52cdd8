"""The tables of release 1.0.0. This step stands as it is; later ones change what it made.

The definitions are those of `storage.tables` at that release: that module goes on, this one does not.
"""

from typing import Any

from alembic import op
from sqlalchemy import Column, ForeignKey, Index, LargeBinary, MetaData, Table, UniqueConstraint, text
from sqlalchemy.types import TypeEngine

from storage.dialects import NUMBER, TEXT, WHOLE

revision = "s0001_first_tables"
down_revision: str | None = None

_metadata = MetaData()


def upgrade() -> None:
    """Make all tables, in a file or on a server."""
    _metadata.create_all(op.get_bind(), checkfirst=False)


def _required(kind: type[TypeEngine[Any]] | TypeEngine[Any], *names: str) -> list[Column[Any]]:
    """Columns that always have a value."""
    return [Column(name, kind, nullable=False) for name in names]


_HELD_ONLY = text("state = 'held'")
_OPEN_ONLY = text("state IN ('waiting', 'running')")

Table(
    "clutch",
    _metadata,
    Column("clutch_id", TEXT, primary_key=True),
    *_required(TEXT, "record", "content_sha256", "created_at"),
    Column("revision", WHOLE, nullable=False),
    Column("rank", NUMBER, nullable=False),
    Column("summary", TEXT, nullable=False),
    Column("archived", WHOLE, nullable=False, server_default="0"),
    Column("registered", TEXT),
    Column("state", TEXT, nullable=False, server_default="check"),
    Column("disputed", TEXT),
    Column("searched", TEXT, nullable=False, server_default=text("''")),
    Column("silent", TEXT),
    Index("clutch_worst_first", "archived", "rank", "clutch_id"),
    Index("clutch_by_state", "archived", "state", "rank", "clutch_id"),
)

Table(
    "run",
    _metadata,
    Column("run_key", WHOLE, primary_key=True),
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), nullable=False),
    Column("run_id", TEXT, nullable=False),
    Column("kind", TEXT, nullable=False),
    Column("cycles", NUMBER, nullable=False),
    Column("started_at", TEXT),
    *_required(TEXT, "received_at", "content_sha256", "details", "receipt", "code_version"),
    Column("state", TEXT, nullable=False, server_default="accepted"),
    Column("sent_cycles", NUMBER),
    Column("doubts", TEXT, nullable=False, server_default="[]"),
    Column("received_by", TEXT),
    UniqueConstraint("clutch_id", "run_id", name="run_once_per_clutch"),
    Index("run_in_order", "clutch_id", "cycles", "run_id"),
    Index("run_held", "clutch_id", sqlite_where=_HELD_ONLY, postgresql_where=_HELD_ONLY),
)

Table(
    "raw_store",
    _metadata,
    Column("store_key", WHOLE, primary_key=True),
    Column("address", TEXT, nullable=False),
    Column("mark", TEXT, nullable=False),
    Column("in_use", WHOLE, nullable=False, server_default="0"),
    Column("removals", WHOLE, nullable=False, server_default="0"),
    UniqueConstraint("address", name="raw_store_once"),
)

Table(
    "raw_removal",
    _metadata,
    Column("store_key", WHOLE, ForeignKey("raw_store.store_key"), primary_key=True),
    Column("blob", TEXT, primary_key=True),
    Column("number", WHOLE, nullable=False),
    Column("at", NUMBER, nullable=False),
    Column("finished", WHOLE, nullable=False),
)

_IN_A_STORE = text("blob IS NOT NULL")

Table(
    "channel",
    _metadata,
    Column("run_key", WHOLE, ForeignKey("run.run_key"), primary_key=True),
    Column("name", TEXT, primary_key=True),
    Column("position", WHOLE, nullable=False),
    Column("codec", TEXT, nullable=False),
    Column("length", WHOLE, nullable=False),
    Column("data", LargeBinary, nullable=False),
    Column("store_key", WHOLE, ForeignKey("raw_store.store_key")),
    Column("blob", TEXT),
    Index("channel_in_store", "store_key", "blob", sqlite_where=_IN_A_STORE, postgresql_where=_IN_A_STORE),
)

Table(
    "fit",
    _metadata,
    Column("run_key", WHOLE, ForeignKey("run.run_key"), primary_key=True),
    Column("pressure", NUMBER, primary_key=True),
    *_required(NUMBER, "mean_pressure", "static_torque", "coulomb_ratio", "stribeck_velocity", "viscous_coefficient"),
    *_required(TEXT, "covariance", "status", "undetermined"),
    Column("noise", NUMBER, nullable=False),
    Column("mse_percent", NUMBER),
    Column("rmse", NUMBER, nullable=False),
    Column("points", WHOLE, nullable=False),
    Column("speeds", WHOLE, nullable=False),
    Column("mean_cof", NUMBER),
    Column("mean_cof_sd", NUMBER),
    Column("message", TEXT, nullable=False),
    Column("code_version", TEXT, nullable=False),
    Column("unbiased_covariance", TEXT),
)

Table(
    "prediction",
    _metadata,
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), primary_key=True),
    Column("method", TEXT, primary_key=True),
    Column("pressure", NUMBER, primary_key=True),
    Column("cycles", NUMBER, primary_key=True),
    Column("payload", TEXT, nullable=False),
    Column("code_version", TEXT, nullable=False),
)

Table(
    "filter_state",
    _metadata,
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), primary_key=True),
    Column("method", TEXT, primary_key=True),
    Column("pressure", NUMBER, primary_key=True),
    Column("runs", WHOLE, nullable=False),
    Column("arrays", LargeBinary, nullable=False),
    Column("code_version", TEXT, nullable=False),
)

Table(
    "diagnosis",
    _metadata,
    Column("diagnosis_key", WHOLE, primary_key=True),
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), nullable=False),
    Column("diagnosis_id", TEXT, nullable=False),
    Column("created_at", TEXT, nullable=False),
    Column("finished_at", TEXT),
    Column("status", TEXT, nullable=False),
    Column("revision", WHOLE, nullable=False),
    Column("last_run_key", WHOLE, nullable=False),
    Column("life", TEXT, nullable=False),
    Column("as_of_cycles", NUMBER),
    Column("report", TEXT),
    Column("extension", TEXT),
    Column("problem", TEXT),
    Column("code_version", TEXT, nullable=False),
    UniqueConstraint("diagnosis_id", name="diagnosis_once"),
    Index("diagnosis_in_order", "clutch_id", "diagnosis_key"),
)

Table(
    "job",
    _metadata,
    Column("job_key", WHOLE, primary_key=True),
    Column("job_id", TEXT, nullable=False),
    Column("kind", TEXT, nullable=False),
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id")),
    *_required(TEXT, "state", "asked_at", "asked_by", "arguments"),
    Column("attempts", WHOLE, nullable=False),
    Column("claimed_by", TEXT),
    Column("leased_until", NUMBER),
    Column("started_at", TEXT),
    Column("finished_at", TEXT),
    Column("progress", TEXT),
    Column("problem", TEXT),
    UniqueConstraint("job_id", name="job_once"),
    Index("job_open", "job_key", sqlite_where=_OPEN_ONLY, postgresql_where=_OPEN_ONLY),
    Index("job_of_clutch", "clutch_id", "started_at"),
)

Table(
    "adopted_model",
    _metadata,
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), primary_key=True),
    Column("version", WHOLE, primary_key=True),
    Column("diagnosis_id", TEXT, ForeignKey("diagnosis.diagnosis_id")),
    Column("adopted_at", TEXT, nullable=False),
)

Table(
    "corrected_cof",
    _metadata,
    Column("run_key", WHOLE, ForeignKey("run.run_key"), primary_key=True),
    Column("pressure", NUMBER, primary_key=True),
    Column("mean_cof", NUMBER, nullable=False),
    Column("mean_cof_sd", NUMBER, nullable=False),
    Column("mean_cof_draws", TEXT),
)

Table(
    "fleet_prior",
    _metadata,
    Column("fleet", TEXT, primary_key=True),
    Column("version", WHOLE, primary_key=True),
    Column("left_out", TEXT, primary_key=True),
    *_required(TEXT, "created_at", "members", "content", "code_version"),
)

Table(
    "inspection",
    _metadata,
    Column("inspection_key", WHOLE, primary_key=True),
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), nullable=False),
    Column("inspection_id", TEXT, nullable=False),
    Column("cycles", NUMBER, nullable=False),
    *_required(TEXT, "content", "content_sha256", "received_at", "received_by", "state"),
    UniqueConstraint("clutch_id", "inspection_id", name="inspection_once_per_clutch"),
    Index("inspection_in_order", "clutch_id", "cycles", "inspection_id"),
)

Table(
    "photograph",
    _metadata,
    Column("sha256", TEXT, primary_key=True),
    Column("media_type", TEXT, nullable=False),
    Column("bytes", WHOLE, nullable=False),
    Column("data", LargeBinary, nullable=False),
)

Table(
    "inspection_photograph",
    _metadata,
    Column("inspection_key", WHOLE, ForeignKey("inspection.inspection_key"), primary_key=True),
    Column("sha256", TEXT, ForeignKey("photograph.sha256"), primary_key=True),
    Column("position", WHOLE, nullable=False),
    Column("received_at", TEXT, nullable=False),
    Column("received_by", TEXT, nullable=False),
)

Table(
    "rig",
    _metadata,
    Column("name", TEXT, primary_key=True),
    Column("version", WHOLE, nullable=False),
    *_required(TEXT, "content", "saved_at", "saved_by"),
)

Table(
    "alarm",
    _metadata,
    Column("alarm_id", TEXT, primary_key=True),
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id")),
    Column("enabled", WHOLE, nullable=False),
    *_required(TEXT, "content", "saved_at", "saved_by"),
)

_NOT_CLEARED = text("cleared_at IS NULL")

Table(
    "alarm_event",
    _metadata,
    Column("event_key", WHOLE, primary_key=True),
    Column("event_id", TEXT, nullable=False),
    Column("alarm_id", TEXT, nullable=False),
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), nullable=False),
    *_required(TEXT, "quantity", "mark", "content", "raised_at"),
    Column("acknowledged_at", TEXT),
    Column("acknowledged_by", TEXT),
    Column("note", TEXT, nullable=False, server_default=text("''")),
    Column("cleared_at", TEXT),
    UniqueConstraint("event_id", name="alarm_event_once"),
    Index(
        "alarm_event_open",
        "clutch_id",
        "alarm_id",
        unique=True,
        sqlite_where=_NOT_CLEARED,
        postgresql_where=_NOT_CLEARED,
    ),
)

Table(
    "webhook",
    _metadata,
    Column("webhook_id", TEXT, primary_key=True),
    *_required(TEXT, "address", "secret", "content", "created_at", "created_by"),
)

_WAITING_ONLY = text("state = 'waiting'")

Table(
    "delivery",
    _metadata,
    Column("delivery_key", WHOLE, primary_key=True),
    Column("delivery_id", TEXT, nullable=False),
    Column("webhook_id", TEXT, ForeignKey("webhook.webhook_id"), nullable=False),
    Column("event_id", TEXT),
    *_required(TEXT, "body", "state", "created_at"),
    Column("due", NUMBER, nullable=False),
    Column("attempts", WHOLE, nullable=False),
    Column("last_attempt_at", TEXT),
    Column("delivered_at", TEXT),
    Column("status", WHOLE),
    Column("problem", TEXT),
    UniqueConstraint("delivery_id", name="delivery_once"),
    Index("delivery_due", "due", sqlite_where=_WAITING_ONLY, postgresql_where=_WAITING_ONLY),
    Index("delivery_of_webhook", "webhook_id", "delivery_key"),
)

Table(
    "change",
    _metadata,
    Column("change_key", WHOLE, primary_key=True),
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), nullable=False),
    Column("run_id", TEXT),
    *_required(TEXT, "at", "by", "action", "reason", "before", "after"),
    Column("revision", WHOLE, nullable=False),
    Index("change_in_order", "clutch_id", "change_key"),
)

Table(
    "access_key",
    _metadata,
    Column("key_id", TEXT, primary_key=True),
    *_required(TEXT, "scope", "secret_sha256", "note", "created_at"),
    Column("revoked_at", TEXT),
    Column("clutches", TEXT),
    Column("expires_at", TEXT),
    Column("last_used_at", TEXT),
    UniqueConstraint("secret_sha256", name="access_key_secret"),
)
