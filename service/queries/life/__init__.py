"""How long a clutch lasts: remaining life as stored or computed, by its criteria, and under planned duty.

In: the rows of a clutch. Out: `/remaining-useful-life` and its forecast. Open `remaining_life.py` first, which answers most
requests; then `criteria.py` (several limits, any quantity, an earlier life) and `planned_duty.py`.
"""
