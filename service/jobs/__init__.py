"""Diagnoses, made outside the process that answers: bounded in number, in time and in memory.

In: a clutch whose runs are to be diagnosed. Out: the report, stored by `workflows/run_diagnosis.py`, or why there is none.
Open `queue.py` first, which runs in the service; `diagnosis.py` is what its child process runs.
"""
