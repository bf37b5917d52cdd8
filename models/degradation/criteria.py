"""The numbers that decide how duty is converted into progress ζ."""

#: Recent duty: the blocks of the last share of the cycles so far, but of so many cycles at least. Chosen; no table.
RECENT_SHARE, RECENT_CYCLES = 0.1, 1_000.0
#: One cycle counts as so many reference cycles at least and at most: a mistyped energy must not end or stop a life. Chosen;
#: no table.
MILDEST, HARSHEST = 1e-3, 1e3
#: The largest exponent q by which severity may enter [-]. Chosen; no table.
LARGEST_EXPONENT = 10.0
#: Where a block does not state how long an engagement lasts, the speed is taken to fall evenly by this much [rad/s²].
#: Chosen: 2,000 rpm come to rest in about one second.
DECELERATION = 200.0
#: The work of a standard cycle: about what the life test's engagements dissipate [J], and how far they slide [rad]. Chosen
#: for the unit of ζ alone.
STANDARD_ENERGY, STANDARD_ANGLE = 20e3, 100.0
