"""Chapter 9, experiments: which test would decide between the hypotheses that are left.

In go a campaign and a judgement; out come tests, best first, with what each is expected to bring. Open `candidates.py`
for the tests, then `test_plan.py`.
"""
