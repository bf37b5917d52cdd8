"""HTTP only: who may ask, what is sent back, and how an error is answered.

In: requests. Out: responses; workflows and queries do the work. Open `routes/life.py` first; then `answers.py` (bodies and
entity tags), `problems.py` (errors), `auth.py` (keys), `middleware.py` (what every request passes).
"""
