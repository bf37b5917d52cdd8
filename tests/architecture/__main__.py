"""`make architecture`: the picture, and what of docs/explanation and docs/reference comes from the code."""

from tests.architecture import document, picture
from tests.documents import reference
from tests.lab.measuring import fill

if __name__ == "__main__":
    picture.main()
    fill(document.DOCUMENT, document.written() | document.measured())
    reference.write(reference.kept())
