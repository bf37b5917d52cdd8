"""Work outside the process that answers: jobs, which wait in the database, and calls that somebody waits for.

In: a job's row, as of a clutch's runs that are to be diagnosed. Out: how it ended, stored as its kind says. Open `queue.py`
first, which runs in every service; `kinds.py` says what a kind of job is; `child.py` is a job's process as the service sees
it, `own_process.py` as it sees itself; `diagnosis.py` and `workflow.py` run in it. `workers.py` holds the lanes of calls.
"""
