"""The simulated rig: `truth` (the clutch) first, then its tests (`stationary`, `sampled`), `campaign`, and
`hidden`: what a diagnosis may be rehearsed on.

In: a seed and a programme. Out: the runs of a campaign as values, whose true end of life is known. Nothing was measured.
Source of what the rig does, by section: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279.
"""
