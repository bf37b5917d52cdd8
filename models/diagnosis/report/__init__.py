"""Chapter 10, the report: everything that a judgement says, in public terms; it changes no verdict.

In go an investigation, a judgement, its validation and advice; out comes a `Report`. Open `report.py`, then `assemble.py`.
"""
