"""Work outside the process that answers: calls that somebody waits for, jobs that wait in the database, and many inputs at
once in a pool of processes or on a cluster.

In: a call of `function(database, ...)`, a job's row, or a function and its inputs. Out: what the call returns, how the job
ended, an `Outcome` for each input. Open `workers.py` first, the lanes of calls that end in time, made by the processes of
`worker.py`; then `queue.py` (jobs), `process.py` (a job's process), `diagnosis.py` and `change.py`, which run in it;
`executor.py` computes many inputs; `background.py` is how a process yields to all others.
"""
