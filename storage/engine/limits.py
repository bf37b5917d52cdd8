"""The bounds that the store keeps to."""

#: [s] How long a transaction waits for the write lock before it gives up with DatabaseBusy. Chosen; no table.
LOCK_TIMEOUT = 10.0
