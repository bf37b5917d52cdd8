"""The steps of the schema, each run once on every database, in the order of their numbers.

In: the schema that the step before left. Out: the schema that this step's docstring describes; rows are kept.
Open `s0003_laws_of_ended_lives.py` first. A released step is never changed: a later one corrects it.
"""
