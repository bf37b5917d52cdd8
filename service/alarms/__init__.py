"""Alarms: rules say when, events say what, an outbox sees to it that receivers learn of it.

In: a clutch's stored results, and the clock. Out: events as rows, and requests to receivers. Open `rules.py` first (what a
rule watches), then `raising.py` (raised, cleared), `outbox.py` (delivered), `receivers.py` (to whom, and to whom not) and
`notify.py` (sends, by whatever way).
"""
