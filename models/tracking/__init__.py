"""One quantity along a life: `posterior` first (what a filter gives), then `prior`, `courses` (forms of the law over
progress), `discrepancy` (what a clutch does beside its course: smooth deviation, steps, a knee ahead), `filters`.

In: fitted values of mean COF or of a Stribeck parameter with their variances, by progress ζ. Out: a weighted sample of
eq. 6's coefficients, from any of three filters that tests force to agree, and whether the last test is off the track.
"""
