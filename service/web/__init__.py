"""HTTP only: who may ask, what is sent back, and how an error is answered.

In: requests. Out: responses; changes and answers do the work, and the answers' cache makes the entity tags. Open
`routes/life.py` first; then `responses.py` (bodies), `problems.py` (errors), `auth.py` (keys), `middleware.py` (what every
request passes).
"""
