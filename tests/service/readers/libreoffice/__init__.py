"""Files that LibreOffice wrote of one record, kept small: `python -m tests.service.readers.libreoffice` writes them again.

CSV as a German, an American and an Indian spreadsheet show numbers, XLS and ODS. Open `__main__` first.
"""
