"""The dashboard: HTML, styles and JavaScript out of `static/` go in, HTTP responses under `/` and `/assets/` come out.

The pages hold no data; they read the API with the reader's key. Open `pages.py` first, then `static/fleet/fleet.js`.
"""
