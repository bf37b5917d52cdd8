"""A Chromium for the page tests: `driving.py` launches and watches it, `python -m tests.browser` gets one where none is."""
