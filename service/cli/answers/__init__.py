"""What the service answers about a clutch, in the terminal: tables for a person, `--json` and `--csv` as they are.

In: a clutch's name and the route's own arguments. Out: lines. Open `request.py` first (how every command asks), then
`life.py`.
"""
