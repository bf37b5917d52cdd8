"""A client of Clutchlife, the condition monitoring of wet friction clutches: `Client`, and the errors that it raises.

In: calls of `Client`. Out: answers of the service as values and tables. Open `client.py` first; `transport` repeats requests
while the service is away, `answers` decides what an answer means, `tables` makes frames of lists.
"""

from .answers import ClutchlifeError, DiagnosisFailedError, RefusedError, ServiceAwayError
from .client import Client

__all__ = ["Client", "ClutchlifeError", "DiagnosisFailedError", "RefusedError", "ServiceAwayError"]
