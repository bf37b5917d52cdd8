"""A diagnosis' gain in predicting the last states has the name that the API gives it, in stored reports, too."""

from alembic import op

revision = "s0004_prediction_gain"
down_revision: str | None = "s0003_fleet_priors"

#: The key in JSON text: within a string its quotes would have a backslash before them.
_OLD, _NEW = '"foretelling_log_score_gain":', '"prediction_log_score_gain":'


def upgrade() -> None:
    """Rename the key in the text of every report; nothing else of a row changes."""
    op.execute(
        f"UPDATE diagnosis SET report = replace(report, '{_OLD}', '{_NEW}') WHERE instr(report, '{_OLD}')"  # noqa: S608
    )
