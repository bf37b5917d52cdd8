"""Chapter 9, experiments: finds the test that would decide between the remaining explanations.

In go a campaign and a judgement; out come tests, best first, with what each is expected to bring. Open `candidates.py`
for the tests, then `test_plan.py`.
"""
