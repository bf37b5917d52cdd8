"""How the diagnosis fares where the friction law is not eq. 3: measured friction curves, other formulas, and eq. 3 beside
them (`make law`). Open `worlds.py`, then `trials.py`.
"""
