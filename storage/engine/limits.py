"""The bounds that the store keeps to."""

#: [s] How long a transaction waits for the write lock before it gives up with DatabaseBusy. Chosen; no table.
LOCK_TIMEOUT = 10.0
#: [byte] Free space on the disk below which the database is not ready where nothing else is said: a large run might no
#: longer fit. Chosen; no table.
LEAST_FREE = 16 << 20
