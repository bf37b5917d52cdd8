"""One file an effect: its formula, its source, its shape grid, its prior. `catalogue.py` one floor up lists them."""
