"""The three filters: `grid` (exact, on a `lattice`), `particle` (a `cloud`) and `ukf` (`sigma_points`).

In: a prior and one measurement after another. Out: a state that is stored, and from it a posterior sample. Start with
`grid`, the reference of the others.
"""
