"""Values as bytes and text: arrays bit for bit with a checksum, JSON without what JSON cannot carry.

In: arrays of 64-bit floats, JSON objects and lists. Out: what a column of a table holds, and the values read back.
Open `codec.py` first; then `json_text.py`.
"""
