"""`make reference`: writes the pages of docs/reference that are made from the code."""

from tests.documents import reference

if __name__ == "__main__":
    reference.write()
