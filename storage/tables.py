"""The tables. What a request reads is stored beside what it was computed from; raw channels are kept bit for bit.

Units are SI (pressure in Pa; 0 stands for the mean over the reference pressures), cycles are duty cycles since new,
times are ISO 8601 text made by the caller. Columns that hold JSON are text, written by `storage.encoding`.
"""

from typing import Any

from sqlalchemy import Column, ForeignKey, Index, LargeBinary, MetaData, Table, UniqueConstraint, text
from sqlalchemy.types import TypeEngine

from storage.dialects import NUMBER, TEXT, WHOLE

metadata = MetaData()


def _required(kind: type[TypeEngine[Any]] | TypeEngine[Any], *names: str) -> list[Column[Any]]:
    """Columns that must have a value."""
    return [Column(name, kind, nullable=False) for name in names]


def _optional(kind: type[TypeEngine[Any]] | TypeEngine[Any], *names: str) -> list[Column[Any]]:
    """Columns that may be null."""
    return [Column(name, kind) for name in names]


#: The name of the column of checksums.
CHECKSUM = "checksum"


def _checksum() -> Column[Any]:
    """A column for the checksum of all other columns of a row (`storage.rows`)."""
    return Column(CHECKSUM, WHOLE, nullable=False, server_default=text("0"))


#: The value stands in the text: with a parameter in its place SQLite would not use the index of held runs alone.
HELD_ONLY = text("state = 'held'")
OPEN_ONLY = text("state IN ('waiting', 'running')")

#: `record` is the record in force, defaults filled in, `registered` that which was posted, where it was edited since; `rank`
#: sorts those in a state, worst first ascending; `archived` is 1 for a clutch that lists leave out. `state` is the name of
#: its state (NAMUR NE 107), which follows from the summary and `disputed`: the life of which the newest finished diagnosis
#: found that data and model disagree, null where there is none or its model is adopted. `searched` is what a search looks
#: into, folded. `silent`: since when its rig has sent nothing, where an alarm of that is raised. `states_sum` is a checksum
#: over those of its filter states: one of an earlier revision, put back with its own checksum, does not pass.
clutch = Table(
    "clutch",
    metadata,
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
    Column("states_sum", WHOLE, nullable=False, server_default=text("0")),
    _checksum(),
    Index("clutch_worst_first", "archived", "rank", "clutch_id"),
    Index("clutch_by_state", "archived", "state", "rank", "clutch_id"),
)

#: `details` holds what only some kinds have (duty, event, note, origin); `receipt` is the answer without what is in other
#: columns: `state` (whether the run counts), `doubts` (why it was held), `sent_cycles` (where `cycles` was corrected since),
#: `received_by` (who posted it).
run = Table(
    "run",
    metadata,
    Column("run_key", WHOLE, primary_key=True),
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), nullable=False),
    *_required(TEXT, "run_id", "kind"),
    Column("cycles", NUMBER, nullable=False),
    Column("started_at", TEXT),
    *_required(TEXT, "received_at", "content_sha256", "details", "receipt", "code_version"),
    Column("state", TEXT, nullable=False, server_default="accepted"),
    Column("sent_cycles", NUMBER),
    Column("doubts", TEXT, nullable=False, server_default="[]"),
    Column("received_by", TEXT),
    _checksum(),
    UniqueConstraint("clutch_id", "run_id", name="run_once_per_clutch"),
    Index("run_in_order", "clutch_id", "cycles", "run_id"),
    Index("run_held", "clutch_id", sqlite_where=HELD_ONLY, postgresql_where=HELD_ONLY),
)

#: Where raw records are kept beside the database: the `address` of a store, and the `mark` that says there whose it is. New
#: ones go to the one that is `in_use` (1), into the database where none is; `removals` counts batches of removed blobs.
raw_store = Table(
    "raw_store",
    metadata,
    Column("store_key", WHOLE, primary_key=True),
    *_required(TEXT, "address", "mark"),
    Column("in_use", WHOLE, nullable=False, server_default="0"),
    Column("removals", WHOLE, nullable=False, server_default="0"),
    UniqueConstraint("address", name="raw_store_once"),
)

#: Blobs that no row names and that are being removed from their store, or (`finished`) were, by the batch's `number`.
raw_removal = Table(
    "raw_removal",
    metadata,
    Column("store_key", WHOLE, ForeignKey("raw_store.store_key"), primary_key=True),
    Column("blob", TEXT, primary_key=True),
    Column("number", WHOLE, nullable=False),
    Column("at", NUMBER, nullable=False),
    Column("finished", WHOLE, nullable=False),
)

#: The value stands in the text, as that of HELD_ONLY.
IN_A_STORE = text("blob IS NOT NULL")

#: An encoded column is in `data`, or it is the `blob` of that name (its SHA-256) in a store, and `data` is empty. The file
#: that a run was read from is a row too, under a name that no channel has (`storage.raw_columns.FILE`).
channel = Table(
    "channel",
    metadata,
    Column("run_key", WHOLE, ForeignKey("run.run_key"), primary_key=True),
    Column("name", TEXT, primary_key=True),
    Column("position", WHOLE, nullable=False),
    Column("codec", TEXT, nullable=False),
    Column("length", WHOLE, nullable=False),
    Column("data", LargeBinary, nullable=False),
    Column("store_key", WHOLE, ForeignKey("raw_store.store_key")),
    Column("blob", TEXT),
    Index("channel_in_store", "store_key", "blob", sqlite_where=IN_A_STORE, postgresql_where=IN_A_STORE),
)

fit = Table(
    "fit",
    metadata,
    Column("run_key", WHOLE, ForeignKey("run.run_key"), primary_key=True),
    Column("pressure", NUMBER, primary_key=True),
    *_required(NUMBER, "mean_pressure", "static_torque", "coulomb_ratio", "stribeck_velocity", "viscous_coefficient"),
    *_required(TEXT, "covariance", "status", "undetermined"),
    Column("noise", NUMBER, nullable=False),
    Column("mse_percent", NUMBER),
    Column("rmse", NUMBER, nullable=False),
    *_required(WHOLE, "points", "speeds"),
    *_optional(NUMBER, "mean_cof", "mean_cof_sd"),
    *_required(TEXT, "message", "code_version"),
    Column("unbiased_covariance", TEXT),
    Column("acceptable", WHOLE, nullable=False, server_default=text("0")),
    Column("measured", TEXT),
    _checksum(),
)

prediction = Table(
    "prediction",
    metadata,
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), primary_key=True),
    Column("method", TEXT, primary_key=True),
    Column("pressure", NUMBER, primary_key=True),
    Column("cycles", NUMBER, primary_key=True),
    *_required(TEXT, "payload", "code_version"),
    _checksum(),
)

filter_state = Table(
    "filter_state",
    metadata,
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), primary_key=True),
    Column("method", TEXT, primary_key=True),
    Column("pressure", NUMBER, primary_key=True),
    Column("runs", WHOLE, nullable=False),
    Column("arrays", LargeBinary, nullable=False),
    Column("code_version", TEXT, nullable=False),
    _checksum(),
)

#: A diagnosis of the runs up to `last_run_key` that belong to the life that `life` names ("" or a rebuild's run_id).
#: `report` is the public answer, `extension` what may be adopted, `problem` why there is none.
diagnosis = Table(
    "diagnosis",
    metadata,
    Column("diagnosis_key", WHOLE, primary_key=True),
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), nullable=False),
    *_required(TEXT, "diagnosis_id", "created_at"),
    Column("finished_at", TEXT),
    Column("status", TEXT, nullable=False),
    *_required(WHOLE, "revision", "last_run_key"),
    Column("life", TEXT, nullable=False),
    Column("as_of_cycles", NUMBER),
    *_optional(TEXT, "report", "extension", "problem"),
    Column("code_version", TEXT, nullable=False),
    _checksum(),
    UniqueConstraint("diagnosis_id", name="diagnosis_once"),
    Index("diagnosis_in_order", "clutch_id", "diagnosis_key"),
)

#: What is asked for and computed by a service when its turn comes. `clutch_id` null: of no single clutch. `arguments` is
#: what the kind of job needs (JSON). While it runs it is `claimed_by`'s, which counts `renewals` up as long as it works;
#: `attempts` counts the claims. `progress` is how far it has come (JSON).
job = Table(
    "job",
    metadata,
    Column("job_key", WHOLE, primary_key=True),
    *_required(TEXT, "job_id", "kind"),
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id")),
    *_required(TEXT, "state", "asked_at", "asked_by", "arguments"),
    Column("attempts", WHOLE, nullable=False),
    Column("claimed_by", TEXT),
    *_optional(TEXT, "started_at", "finished_at", "progress", "problem"),
    Column("renewals", WHOLE, nullable=False, server_default=text("0")),
    UniqueConstraint("job_id", name="job_once"),
    Index("job_open", "job_key", sqlite_where=OPEN_ONLY, postgresql_where=OPEN_ONLY),
    Index("job_of_clutch", "clutch_id", "started_at"),
)

#: The models that a clutch has been tracked under, by version; `diagnosis_id` null is the baseline.
adopted_model = Table(
    "adopted_model",
    metadata,
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), primary_key=True),
    Column("version", WHOLE, primary_key=True),
    Column("diagnosis_id", TEXT, ForeignKey("diagnosis.diagnosis_id")),
    Column("adopted_at", TEXT, nullable=False),
    _checksum(),
)

#: Mean COF under the adopted model, beside that of the fits, where the model corrects the measurement for an artefact.
corrected_cof = Table(
    "corrected_cof",
    metadata,
    Column("run_key", WHOLE, ForeignKey("run.run_key"), primary_key=True),
    Column("pressure", NUMBER, primary_key=True),
    *_required(NUMBER, "mean_cof", "mean_cof_sd"),
    Column("mean_cof_draws", TEXT),
    _checksum(),
)

#: Priors learned from fleets of earlier lives, by version from 1 on. `fleet` names the kind of clutch (JSON), `left_out`
#: the clutch that was not learned from, the first of them where there were several, "" where all were; `members` are the
#: clutches of the fleet.
fleet_prior = Table(
    "fleet_prior",
    metadata,
    Column("fleet", TEXT, primary_key=True),
    Column("version", WHOLE, primary_key=True),
    Column("left_out", TEXT, primary_key=True),
    *_required(TEXT, "created_at", "members", "content", "code_version"),
    _checksum(),
)

#: What was found where the clutch was taken apart. `content` is what was posted (JSON, in the units of its fields' names),
#: `content_sha256` its hash, `state` whether it was withdrawn since.
inspection = Table(
    "inspection",
    metadata,
    Column("inspection_key", WHOLE, primary_key=True),
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), nullable=False),
    Column("inspection_id", TEXT, nullable=False),
    Column("cycles", NUMBER, nullable=False),
    *_required(TEXT, "content", "content_sha256", "received_at", "received_by", "state"),
    _checksum(),
    UniqueConstraint("clutch_id", "inspection_id", name="inspection_once_per_clutch"),
    Index("inspection_in_order", "clutch_id", "cycles", "inspection_id"),
)

#: Photographs as they were sent, each once whatever shows it: its name is the hash of its `data`.
photograph = Table(
    "photograph",
    metadata,
    Column("sha256", TEXT, primary_key=True),
    Column("media_type", TEXT, nullable=False),
    Column("bytes", WHOLE, nullable=False),
    Column("data", LargeBinary, nullable=False),
)

#: The photographs of an inspection, by `position` in the order in which they came.
inspection_photograph = Table(
    "inspection_photograph",
    metadata,
    Column("inspection_key", WHOLE, ForeignKey("inspection.inspection_key"), primary_key=True),
    Column("sha256", TEXT, ForeignKey("photograph.sha256"), primary_key=True),
    Column("position", WHOLE, nullable=False),
    *_required(TEXT, "received_at", "received_by"),
)

#: Rig profiles: how the files of a rig are read. `content` is the profile (JSON) in force, `version` counts from 1 on.
rig = Table(
    "rig",
    metadata,
    Column("name", TEXT, primary_key=True),
    Column("version", WHOLE, nullable=False),
    *_required(TEXT, "content", "saved_at", "saved_by"),
    _checksum(),
)

#: Rules of alarms. `content` is the rule (JSON) in force; `clutch_id` null: of all clutches, or of those that `content`
#: names.
alarm = Table(
    "alarm",
    metadata,
    Column("alarm_id", TEXT, primary_key=True),
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id")),
    Column("enabled", WHOLE, nullable=False),
    *_required(TEXT, "content", "saved_at", "saved_by"),
    _checksum(),
)

#: The value stands in the text, as that of HELD_ONLY.
NOT_CLEARED = text("cleared_at IS NULL")

#: What rules have raised: once for a clutch until it is cleared. `mark` tells what raised it from what would raise it again
#: (a diagnosis' verdict); `content` is what is said of it (JSON). The rule may be gone.
alarm_event = Table(
    "alarm_event",
    metadata,
    Column("event_key", WHOLE, primary_key=True),
    *_required(TEXT, "event_id", "alarm_id"),
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), nullable=False),
    *_required(TEXT, "quantity", "mark", "content", "raised_at"),
    *_optional(TEXT, "acknowledged_at", "acknowledged_by"),
    Column("note", TEXT, nullable=False, server_default=text("''")),
    Column("cleared_at", TEXT),
    _checksum(),
    UniqueConstraint("event_id", name="alarm_event_once"),
    Index(
        "alarm_event_open", "clutch_id", "alarm_id", unique=True, sqlite_where=NOT_CLEARED, postgresql_where=NOT_CLEARED
    ),
)

#: Receivers of alarms. `address` may hold a password, and `secret` signs what is sent.
webhook = Table(
    "webhook",
    metadata,
    Column("webhook_id", TEXT, primary_key=True),
    *_required(TEXT, "address", "secret", "content", "created_at", "created_by"),
    _checksum(),
)

#: The value stands in the text, as that of HELD_ONLY.
WAITING_ONLY = text("state = 'waiting'")

#: The outbox: what a receiver is to be sent, in the transaction that raised it; `event_id` null: a test. It is tried at
#: `due` (seconds by the database's clock), which whoever tries it moves on first, until it is delivered or given up.
delivery = Table(
    "delivery",
    metadata,
    Column("delivery_key", WHOLE, primary_key=True),
    Column("delivery_id", TEXT, nullable=False),
    Column("webhook_id", TEXT, ForeignKey("webhook.webhook_id"), nullable=False),
    Column("event_id", TEXT),
    *_required(TEXT, "body", "state", "created_at"),
    Column("due", NUMBER, nullable=False),
    Column("attempts", WHOLE, nullable=False),
    *_optional(TEXT, "last_attempt_at", "delivered_at"),
    Column("status", WHOLE),
    Column("problem", TEXT),
    UniqueConstraint("delivery_id", name="delivery_once"),
    Index("delivery_due", "due", sqlite_where=WAITING_ONLY, postgresql_where=WAITING_ONLY),
    Index("delivery_of_webhook", "webhook_id", "delivery_key"),
)

#: The audit trail: who changed what of a clutch (`run_id` null) or of one of its runs, when and why, and the revision from
#: then on. `before` and `after` hold what changed.
change = Table(
    "change",
    metadata,
    Column("change_key", WHOLE, primary_key=True),
    Column("clutch_id", TEXT, ForeignKey("clutch.clutch_id"), nullable=False),
    Column("run_id", TEXT),
    *_required(TEXT, "at", "by", "action", "reason", "before", "after"),
    Column("revision", WHOLE, nullable=False),
    _checksum(),
    Index("change_in_order", "clutch_id", "change_key"),
)

#: `clutches` are the clutches that a key is bound to (JSON), null where it is bound to none.
access_key = Table(
    "access_key",
    metadata,
    Column("key_id", TEXT, primary_key=True),
    *_required(TEXT, "scope", "secret_sha256", "note", "created_at"),
    *_optional(TEXT, "revoked_at", "clutches", "expires_at", "last_used_at"),
    UniqueConstraint("secret_sha256", name="access_key_secret"),
)
