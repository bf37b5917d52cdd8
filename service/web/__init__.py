"""HTTP only: who may ask, what is sent back, and how an error is answered.

In: requests. Out: responses; workflows and queries do the work, and the queries' cache makes the entity tags. Open
`routes/life.py` first; then `answers.py` (bodies), `problems.py` (errors), `auth.py` (keys), `middleware.py` (what every
request passes).
"""
