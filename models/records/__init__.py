"""Raw records: `runs` first (what a test is), then `plateaus`, which goes through cleaning, dwells, settling and deviations.

In: the columns of a test in SI units. Out: steady plateaus with the deviation of each mean; for dynamic tests the stretches
of constant pressure and the periods of the swing.
"""
