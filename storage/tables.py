"""The tables. What a request reads is stored beside what it was computed from; raw channels are kept bit for bit.

Units are SI (pressure in Pa; 0 stands for the mean over the reference pressures), cycles are duty cycles since new,
times are ISO 8601 text made by the caller. Columns that hold JSON are text, written by `storage.encoding.json_text`.
"""

from sqlalchemy import (
    REAL,
    Column,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
    text,
)

metadata = MetaData()

#: `record` is the record in force, defaults filled in, `registered` that which was posted, where it was edited since; `rank`
#: sorts lists, worst first ascending; `archived` is 1 for a clutch that lists leave out.
clutch = Table(
    "clutch",
    metadata,
    Column("clutch_id", Text, primary_key=True),
    Column("record", Text, nullable=False),
    Column("content_sha256", Text, nullable=False),
    Column("created_at", Text, nullable=False),
    Column("revision", Integer, nullable=False),
    Column("rank", REAL, nullable=False),
    Column("summary", Text, nullable=False),
    Column("archived", Integer, nullable=False, server_default="0"),
    Column("registered", Text),
    Index("clutch_worst_first", "rank", "clutch_id"),
)

#: `details` holds what only some kinds have (duty, event, note, origin); `receipt` is the answer without what is in other
#: columns: `state` (whether the run counts), `doubts` (why it was held), `sent_cycles` (where `cycles` was corrected since),
#: `received_by` (who posted it; null for runs of earlier releases).
run = Table(
    "run",
    metadata,
    Column("run_key", Integer, primary_key=True),
    Column("clutch_id", Text, ForeignKey("clutch.clutch_id"), nullable=False),
    Column("run_id", Text, nullable=False),
    Column("kind", Text, nullable=False),
    Column("cycles", REAL, nullable=False),
    Column("started_at", Text),
    Column("received_at", Text, nullable=False),
    Column("content_sha256", Text, nullable=False),
    Column("details", Text, nullable=False),
    Column("receipt", Text, nullable=False),
    Column("code_version", Text, nullable=False),
    Column("state", Text, nullable=False, server_default="accepted"),
    Column("sent_cycles", REAL),
    Column("doubts", Text, nullable=False, server_default="[]"),
    Column("received_by", Text),
    UniqueConstraint("clutch_id", "run_id", name="run_once_per_clutch"),
    Index("run_in_order", "clutch_id", "cycles", "run_id"),
    Index("run_held", "clutch_id", sqlite_where=text("state = 'held'")),
)

channel = Table(
    "channel",
    metadata,
    Column("run_key", Integer, ForeignKey("run.run_key"), primary_key=True),
    Column("name", Text, primary_key=True),
    Column("position", Integer, nullable=False),
    Column("codec", Text, nullable=False),
    Column("length", Integer, nullable=False),
    Column("data", LargeBinary, nullable=False),
)

fit = Table(
    "fit",
    metadata,
    Column("run_key", Integer, ForeignKey("run.run_key"), primary_key=True),
    Column("pressure", REAL, primary_key=True),
    Column("mean_pressure", REAL, nullable=False),
    Column("static_torque", REAL, nullable=False),
    Column("coulomb_ratio", REAL, nullable=False),
    Column("stribeck_velocity", REAL, nullable=False),
    Column("viscous_coefficient", REAL, nullable=False),
    Column("covariance", Text, nullable=False),
    Column("status", Text, nullable=False),
    Column("undetermined", Text, nullable=False),
    Column("noise", REAL, nullable=False),
    Column("mse_percent", REAL),
    Column("rmse", REAL, nullable=False),
    Column("points", Integer, nullable=False),
    Column("speeds", Integer, nullable=False),
    Column("mean_cof", REAL),
    Column("mean_cof_sd", REAL),
    Column("message", Text, nullable=False),
    Column("code_version", Text, nullable=False),
)

prediction = Table(
    "prediction",
    metadata,
    Column("clutch_id", Text, ForeignKey("clutch.clutch_id"), primary_key=True),
    Column("method", Text, primary_key=True),
    Column("pressure", REAL, primary_key=True),
    Column("cycles", REAL, primary_key=True),
    Column("payload", Text, nullable=False),
    Column("code_version", Text, nullable=False),
)

filter_state = Table(
    "filter_state",
    metadata,
    Column("clutch_id", Text, ForeignKey("clutch.clutch_id"), primary_key=True),
    Column("method", Text, primary_key=True),
    Column("pressure", REAL, primary_key=True),
    Column("runs", Integer, nullable=False),
    Column("arrays", LargeBinary, nullable=False),
    Column("code_version", Text, nullable=False),
)

#: A diagnosis of the runs up to `last_run_key` that belong to the life that `life` names ("" or a rebuild's run_id).
#: `report` is the public answer, `extension` what may be adopted, `problem` why there is none.
diagnosis = Table(
    "diagnosis",
    metadata,
    Column("diagnosis_key", Integer, primary_key=True),
    Column("clutch_id", Text, ForeignKey("clutch.clutch_id"), nullable=False),
    Column("diagnosis_id", Text, nullable=False),
    Column("created_at", Text, nullable=False),
    Column("finished_at", Text),
    Column("status", Text, nullable=False),
    Column("revision", Integer, nullable=False),
    Column("last_run_key", Integer, nullable=False),
    Column("life", Text, nullable=False),
    Column("as_of_cycles", REAL),
    Column("report", Text),
    Column("extension", Text),
    Column("problem", Text),
    Column("code_version", Text, nullable=False),
    UniqueConstraint("diagnosis_id", name="diagnosis_once"),
    Index("diagnosis_in_order", "clutch_id", "diagnosis_key"),
)

#: The models that a clutch has been tracked under, by version; `diagnosis_id` null is the baseline.
adopted_model = Table(
    "adopted_model",
    metadata,
    Column("clutch_id", Text, ForeignKey("clutch.clutch_id"), primary_key=True),
    Column("version", Integer, primary_key=True),
    Column("diagnosis_id", Text, ForeignKey("diagnosis.diagnosis_id")),
    Column("adopted_at", Text, nullable=False),
)

#: Mean COF under the adopted model, beside that of the fits, where the model corrects the measurement for an artefact.
corrected_cof = Table(
    "corrected_cof",
    metadata,
    Column("run_key", Integer, ForeignKey("run.run_key"), primary_key=True),
    Column("pressure", REAL, primary_key=True),
    Column("mean_cof", REAL, nullable=False),
    Column("mean_cof_sd", REAL, nullable=False),
)

#: Priors learned from fleets of earlier lives, by version from 1 on. `fleet` names the kind of clutch (JSON), `left_out`
#: the clutch that was not learned from, the first of them where there were several, "" where all were; `members` are the
#: clutches of the fleet.
fleet_prior = Table(
    "fleet_prior",
    metadata,
    Column("fleet", Text, primary_key=True),
    Column("version", Integer, primary_key=True),
    Column("left_out", Text, primary_key=True),
    Column("created_at", Text, nullable=False),
    Column("members", Text, nullable=False),
    Column("content", Text, nullable=False),
    Column("code_version", Text, nullable=False),
)

#: What was found where the clutch was taken apart. `content` is what was posted (JSON, in the units of its fields' names),
#: `content_sha256` its hash, `state` whether it was withdrawn since.
inspection = Table(
    "inspection",
    metadata,
    Column("inspection_key", Integer, primary_key=True),
    Column("clutch_id", Text, ForeignKey("clutch.clutch_id"), nullable=False),
    Column("inspection_id", Text, nullable=False),
    Column("cycles", REAL, nullable=False),
    Column("content", Text, nullable=False),
    Column("content_sha256", Text, nullable=False),
    Column("received_at", Text, nullable=False),
    Column("received_by", Text, nullable=False),
    Column("state", Text, nullable=False),
    UniqueConstraint("clutch_id", "inspection_id", name="inspection_once_per_clutch"),
    Index("inspection_in_order", "clutch_id", "cycles", "inspection_id"),
)

#: Photographs as they were sent, each once whatever shows it: its name is the hash of its `data`.
photograph = Table(
    "photograph",
    metadata,
    Column("sha256", Text, primary_key=True),
    Column("media_type", Text, nullable=False),
    Column("bytes", Integer, nullable=False),
    Column("data", LargeBinary, nullable=False),
)

#: The photographs of an inspection, by `position` in the order in which they came.
inspection_photograph = Table(
    "inspection_photograph",
    metadata,
    Column("inspection_key", Integer, ForeignKey("inspection.inspection_key"), primary_key=True),
    Column("sha256", Text, ForeignKey("photograph.sha256"), primary_key=True),
    Column("position", Integer, nullable=False),
    Column("received_at", Text, nullable=False),
    Column("received_by", Text, nullable=False),
)

#: The audit trail: who changed what of a clutch (`run_id` null) or of one of its runs, when and why, and the revision from
#: then on. `before` and `after` hold what changed.
change = Table(
    "change",
    metadata,
    Column("change_key", Integer, primary_key=True),
    Column("clutch_id", Text, ForeignKey("clutch.clutch_id"), nullable=False),
    Column("run_id", Text),
    Column("at", Text, nullable=False),
    Column("by", Text, nullable=False),
    Column("action", Text, nullable=False),
    Column("reason", Text, nullable=False),
    Column("before", Text, nullable=False),
    Column("after", Text, nullable=False),
    Column("revision", Integer, nullable=False),
    Index("change_in_order", "clutch_id", "change_key"),
)

#: `clutches` are the clutches that a key is bound to (JSON), null where it is bound to none.
access_key = Table(
    "access_key",
    metadata,
    Column("key_id", Text, primary_key=True),
    Column("scope", Text, nullable=False),
    Column("secret_sha256", Text, nullable=False),
    Column("note", Text, nullable=False),
    Column("created_at", Text, nullable=False),
    Column("revoked_at", Text),
    Column("clutches", Text),
    Column("expires_at", Text),
    Column("last_used_at", Text),
    UniqueConstraint("secret_sha256", name="access_key_secret"),
)
