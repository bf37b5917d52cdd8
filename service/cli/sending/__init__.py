"""Runs on their way to a service.

In: run files. Out: stored runs, or runs that wait in a spool on disk. Open `push` first (the commands `push` and
`spool`). `spool` keeps runs until they are stored, and knows which is a newer version of which; `delivery` sends what waits.
"""
