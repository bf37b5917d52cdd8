"""The three filters of one quantity along a life; tests force them to agree.

In: a prior and one measurement after another. Out: a state that is stored, and from it a posterior sample. Open `grid.py`
first: exact, on a `lattice`, the reference of the others; then `particle.py` and `ukf.py`.
"""
