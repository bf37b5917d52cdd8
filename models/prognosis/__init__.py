"""The end of life: `first_passage` first, then `stated_end` with `back_cast` and `ended_lives` (what earlier forecasts and
earlier lives say), `course_shares`, `slope_paths` (the margin against shudder), `fleet`
and `scoring`.

In: posterior samples of eq. 6 and its family. Out: quantiles of the end of life and the probability of reaching it; the
prior that earlier lives give to the next one; how good predictions were once the end is known.
"""
