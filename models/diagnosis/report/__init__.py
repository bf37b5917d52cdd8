"""Chapter 10, the report: states the judgement in public names and units, and changes no verdict.

In go an investigation, a judgement, its validation and advice; out comes a `Report`. Open `report.py`, then `assemble.py`.
"""
