"""The service: clutches, their runs and their prognosis over HTTP, and the command line.

In: run files and JSON bodies. Out: receipts, predictions, diagnoses, the dashboard. Open `app.py` first, which puts all
together; then `web/` (HTTP), `changes/` (one file a change), `answers/` (one file an answer), `clutch/` (computed values).
"""
