"""Alarms: rules, what they raised, receivers, and the outbox of what these are to be sent."""

import sqlalchemy as sa
from alembic import op

from storage.dialects import NUMBER, TEXT, WHOLE

revision = "s0014_alarms"
down_revision: str | None = "s0013_corrected_cof_draws"

_NOT_CLEARED = sa.text("cleared_at IS NULL")
_WAITING_ONLY = sa.text("state = 'waiting'")


def upgrade() -> None:
    """Make the tables, empty, and the column that says since when a rig is silent: no rule was there that could say so."""
    op.add_column("clutch", sa.Column("silent", TEXT))
    op.create_table(
        "alarm",
        sa.Column("alarm_id", TEXT, primary_key=True),
        sa.Column("clutch_id", TEXT, sa.ForeignKey("clutch.clutch_id")),
        sa.Column("enabled", WHOLE, nullable=False),
        sa.Column("content", TEXT, nullable=False),
        sa.Column("saved_at", TEXT, nullable=False),
        sa.Column("saved_by", TEXT, nullable=False),
    )
    op.create_table(
        "alarm_event",
        sa.Column("event_key", WHOLE, primary_key=True),
        sa.Column("event_id", TEXT, nullable=False),
        sa.Column("alarm_id", TEXT, nullable=False),
        sa.Column("clutch_id", TEXT, sa.ForeignKey("clutch.clutch_id"), nullable=False),
        sa.Column("quantity", TEXT, nullable=False),
        sa.Column("mark", TEXT, nullable=False),
        sa.Column("content", TEXT, nullable=False),
        sa.Column("raised_at", TEXT, nullable=False),
        sa.Column("acknowledged_at", TEXT),
        sa.Column("acknowledged_by", TEXT),
        sa.Column("note", TEXT, nullable=False, server_default=sa.text("''")),
        sa.Column("cleared_at", TEXT),
        sa.UniqueConstraint("event_id", name="alarm_event_once"),
    )
    op.create_index(
        "alarm_event_open",
        "alarm_event",
        ["clutch_id", "alarm_id"],
        unique=True,
        sqlite_where=_NOT_CLEARED,
        postgresql_where=_NOT_CLEARED,
    )
    op.create_table(
        "webhook",
        sa.Column("webhook_id", TEXT, primary_key=True),
        sa.Column("address", TEXT, nullable=False),
        sa.Column("secret", TEXT, nullable=False),
        sa.Column("content", TEXT, nullable=False),
        sa.Column("created_at", TEXT, nullable=False),
        sa.Column("created_by", TEXT, nullable=False),
    )
    op.create_table(
        "delivery",
        sa.Column("delivery_key", WHOLE, primary_key=True),
        sa.Column("delivery_id", TEXT, nullable=False),
        sa.Column("webhook_id", TEXT, sa.ForeignKey("webhook.webhook_id"), nullable=False),
        sa.Column("event_id", TEXT),
        sa.Column("body", TEXT, nullable=False),
        sa.Column("state", TEXT, nullable=False),
        sa.Column("created_at", TEXT, nullable=False),
        sa.Column("due", NUMBER, nullable=False),
        sa.Column("attempts", WHOLE, nullable=False),
        sa.Column("last_attempt_at", TEXT),
        sa.Column("delivered_at", TEXT),
        sa.Column("status", WHOLE),
        sa.Column("problem", TEXT),
        sa.UniqueConstraint("delivery_id", name="delivery_once"),
    )
    op.create_index("delivery_due", "delivery", ["due"], sqlite_where=_WAITING_ONLY, postgresql_where=_WAITING_ONLY)
    op.create_index("delivery_of_webhook", "delivery", ["webhook_id", "delivery_key"])
