"""Alarms: rules say when, events say what, an outbox sees to it that receivers learn of it.

In: a clutch's stored results, and the clock. Out: events as rows, and requests to receivers. Open `rules.py` first (what a
rule watches), then `raising.py` (raised, cleared), `outbox.py` (delivered), `receivers.py` (which addresses are
allowed, and the POST to a web address) and `notify.py` (chooses the way: that POST, or Apprise in a process of its own).
"""
