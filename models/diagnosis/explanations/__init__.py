"""Chapter 7, the explanations: gives each possible explanation of a campaign a probability, and reads the verdict from them.

In go a baseline and what raw records show; out come the explanations with their probabilities and the verdict that is
read off them. Open `posterior.py` first, then `evidence.py` (what one explanation is worth) and `decide.py`.
"""
