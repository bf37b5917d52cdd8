"""The diagnosis of a life, at its two edges: what goes into `models.diagnosis`, and its report in the public shape.

In: the runs of a life, and a report. Out: a campaign in SI units within bounds on memory, and the report as it is answered.
Open `campaign.py` first; then `report.py`.
"""
