"""One run with its channels: all samples, or few enough for a plot.

In: the database, a run's name, how many points are wanted and in which format. Out: a file that holds the answer's body, and
the answer's entity tag, which follows from stored rows alone. Open `answer.py` first; then `formats.py`.
"""
