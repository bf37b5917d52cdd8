"""Diagnosis: a clutch's campaign goes in; what the model gets wrong, its cause and the test that would decide come out.

Open diagnose.py first: it is the table of contents. The chapters, in reading order, none importing a later one:

campaign      the input: all runs of one life of a clutch
design        1  the rows that are fitted, and what is known beside them
baseline      2  the physics: Stribeck curves over pressure and life, friction lag in loops
noise         3  the sensor's noise and the scatter of gains
effects       4  what could be wrong: the catalogue and the uncatalogued rig faults
pooled_fit    5  one parameter vector fitted to the whole campaign
raw_records   6  what swings and settles within a record
explanations  7  what may be behind it, as one posterior, and the verdict
validation    8  does it predict what was held out
experiments   9  which test to make next
report       10  what is said; never changes a verdict
"""
