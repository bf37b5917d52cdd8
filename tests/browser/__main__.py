"""`python -m tests.browser`: see that there is a browser, and get one where there is none."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from tests.browser.driving import system


def find() -> str | None:
    """The browser to drive: $CHROMIUM, one on the path, or Playwright's own."""
    with sync_playwright() as playwright:
        own = playwright.chromium.executable_path
    return system() or (own if Path(own).exists() else None)


def install() -> str | None:
    """Get a browser: as root from Debian's packages where there are any, else Playwright's download into the home folder."""
    if os.geteuid() == 0 and shutil.which("apt-get"):
        environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
        for command in (["update", "-q"], ["install", "-qy", "--no-install-recommends", "chromium"]):
            subprocess.run(["apt-get", *command], check=False, stdout=subprocess.DEVNULL, env=environment)
        if found := find():
            return found
    subprocess.run([sys.executable, "-m", "playwright", "install", "chromium"], check=False)
    return find()


found = find() or install()
if found is None:
    sys.exit(
        "The page tests need Chromium and it could not be installed. Install one (Debian, Ubuntu: apt install chromium; "
        "or: python -m playwright install --with-deps chromium), or name it: CHROMIUM=/path/to/chromium make test"
    )
print(f"page tests drive {found}")
