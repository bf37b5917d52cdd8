"""`python -m tests.browser`: see that there is a browser, and get one where there is none."""

import sys

from tests.browser import find, install

found = find() or install()
if found is None:
    print(
        "The page tests need Chromium and it could not be installed. Install one (Debian, Ubuntu: apt install chromium; "
        "or: python -m playwright install --with-deps chromium), or name it: CHROMIUM=/path/to/chromium make test",
        file=sys.stderr,
    )
    sys.exit(1)
print(f"page tests drive {found}")
