"""The end of life: `first_passage` first, then `from_parameters` (a second way to mean COF), `fleet` and `scoring`.

In: posterior samples of eq. 6. Out: quantiles of the end of life and the probability of reaching it; the prior that earlier
lives give to the next one; how good predictions were once the end is known.
"""
