"""Limits of what is analysed of raw records. Chosen for time; no table."""

#: Records analysed, taken evenly over life: at least so many, more where they hold fewer than so many samples in all.
FEW_RECORDS = 8
MANY_SAMPLES = 300_000
#: Windows in which a fixed frequency is looked for, at most, taken evenly.
MOST_WINDOWS = 400
