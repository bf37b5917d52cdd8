"""Runs on their way to a service.

In: run files. Out: stored runs, or runs that wait in a spool on disk. Open `push` (the command) first; `client` sends
and waits while it is away, `spool` keeps runs until they are stored.
"""
