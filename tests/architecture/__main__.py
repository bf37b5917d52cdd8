"""`make architecture`: the picture, and the parts of docs/explanation/architecture.md that come from the code."""

import sys

from tests.architecture import document, picture
from tests.documents import __main__ as reference
from tests.measuring import fill


def main() -> int:
    """Write both, and the pages of docs/reference."""
    picture.main()
    fill(document.DOCUMENT, document.written() | document.measured())
    return reference.main()


if __name__ == "__main__":
    sys.exit(main())
