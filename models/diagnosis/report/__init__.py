"""Chapter 10, the report: writes the result in the names and units of the API, and changes no verdict.

In go an investigation, a judgement, its validation and advice; out comes a `Report`. Open `report.py`, then `assemble.py`.
"""
