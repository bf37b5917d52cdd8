"""The addresses, one file a subject.

In: a request's path, arguments and body. Out: a response; a route calls one change or one answer and does no more. Open
`runs.py` first, which posts and lists; `exports.py` are all CSV exports.
"""
