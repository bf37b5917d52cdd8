"""`make reference`: writes the pages of docs/reference that are made from the code."""

import sys

from tests.documents import reference


def main() -> int:
    """Write all of them."""
    for path, text in reference.pages().items():
        path.write_text(text, encoding="utf-8")
        print(f"{path.relative_to(reference.ROOT)}: {len(text.splitlines())} lines")
    return 0


if __name__ == "__main__":
    sys.exit(main())
