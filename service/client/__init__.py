"""The Python client, a distribution of its own with its own pyproject.toml, which comes with the service too.

In: calls. Out: requests to a service, and its answers as values, tables and exceptions. Open `clutchlife/client.py` first.
The folder `clutchlife` is the package that scripts import; the service's own commands import the same files from here.
"""
