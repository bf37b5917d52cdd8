"""A draw of files as rigs, loggers and spreadsheets write them, and how many are read, suggested, asked for, or wrong.

In: a seed. Out: a table. `writers` makes a test as a file of a public program, with the channels that are in it; `draw`
reads each file and judges it. `writers` is made from what programs write and never from what the readers know.
"""
