"""The simulated rig: `truth` (the clutch) first, then its tests (`stationary`, `sampled`), `campaign`, and
`hidden`: what a diagnosis may be rehearsed on.

In: a seed and a programme. Out: the runs of a campaign as values, whose true end of life is known. Nothing was measured.
"""
