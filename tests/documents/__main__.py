"""`make reference`: writes all pages that are made from the code. `made`, as for `make docs`: those out of git alone."""

import sys

from tests.documents import reference

if __name__ == "__main__":
    reference.write(reference.made() if "made" in sys.argv else reference.pages())
