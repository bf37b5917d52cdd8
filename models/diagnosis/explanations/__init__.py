"""Chapter 7, the explanations: what may be behind a campaign, as one posterior over an exclusive list.

In go a baseline and what raw records show; out come the explanations with their probabilities and the verdict that is
read off them. Open `posterior.py` first, then `evidence.py` (what one explanation is worth) and `decide.py`.
"""
