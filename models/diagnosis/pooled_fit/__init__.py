"""Chapter 5, the pooled fit: fits one parameter vector, with or without effects, to all rows of a campaign at once.

In goes a `FitProblem` (design, noise, priors); out come a `Fit` and what else is visible beside it. Open `problem.py`, then
`baseline_fit.py`.
"""
