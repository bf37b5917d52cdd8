"""Runs on their way to a service.

In: run files. Out: stored runs, or runs that wait in a spool on disk. Open `push` (the command) first. `spool` keeps runs
until they are stored (`entry`: one of them, `run_head`: which is a newer version of which, `spool_files`: the steps on disk,
`folder_lock`: one process at a time); `transmission` and `delivery` send what waits, by way of `client`; `answers` decides
what an answer means for a run; `spool_commands` shows, sends and empties the spool.
"""
