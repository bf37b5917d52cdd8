"""Commands that look at runs and mend what was mistyped, and the audit trail.

In: a clutch's name, a run's, and a reason. Out: lines for a person, or `--json`. Open `run_changes.py` first.
"""
