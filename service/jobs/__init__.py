"""Work outside the process that answers: jobs, which wait in the database, and calls that somebody waits for.

In: a job's row, as of a clutch's runs that are to be diagnosed. Out: the report, stored by `workflows/run_diagnosis.py`, or
why there is none. Open `queue.py` first, which runs in every service; `child.py` is the process of one diagnosis as it sees
it, `diagnosis.py` what runs in that. `workers.py` holds the lanes of calls.
"""
