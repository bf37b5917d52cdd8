"""The law of ageing and what drives it: `general_order` (eq. 6) first, then `severity` (duty so far, and planned).

In: the coefficients of eq. 6 and a clutch's blocks of duty. Out: the quantity after ζ cycles, the ζ at which it reaches a
level, and ζ as a function of duty cycles where severity counts.
"""
