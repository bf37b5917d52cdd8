"""The explanations: what may be behind a campaign, as one posterior over an exclusive list. It makes no verdict yet.

It stands beside detection and attribution until `make blind SUBSET=` has shown that it does no worse in any row. In go a
baseline and what raw records show; out come the explanations with their probabilities and the verdict that is read off them.
Open `posterior.py` first, then `evidence.py` (what one explanation is worth) and `decide.py`.
"""
