"""The documents: reference pages are made from the code, words are counted and judged, figures of the gallery are drawn.

In: docs/, README.md and the code. Out: pages and verdicts. Open `reference.py` first.
"""
