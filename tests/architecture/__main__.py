"""`make architecture`: the picture, and the parts of docs/explanation/architecture.md that come from the code."""

import sys

from tests.architecture import document, picture
from tests.documents import __main__ as reference


def main() -> int:
    """Write both, and the pages of docs/reference."""
    picture.main()
    text = document.DOCUMENT.read_text(encoding="utf-8")
    text = document.filled(text, document.written() | document.measured())
    document.DOCUMENT.write_text(text, encoding="utf-8")
    return reference.main()


if __name__ == "__main__":
    sys.exit(main())
