"""Immutable bytes beside the database, named by their SHA-256: the long columns of raw records, in a folder or a bucket.

In: bytes and the address of a store, `folder:///path` or `s3://bucket/prefix`. Out: by their name the same bytes again.
Open `stores.py` first; `raw_stores.py` has the rows of stores and of what is removed from them.
"""
