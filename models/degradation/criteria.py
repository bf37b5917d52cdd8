"""The numbers that decide how duty is converted into progress ζ."""

#: The largest exponent q by which severity may enter [-]. Chosen; no table.
LARGEST_EXPONENT = 10.0
#: The work of a standard cycle: about what the life test's engagements dissipate [J], and how far they slide [rad]. Chosen
#: for the unit of ζ alone.
STANDARD_ENERGY, STANDARD_ANGLE = 20e3, 100.0
