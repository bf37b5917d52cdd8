# ruff: noqa: N818 - the names say what is wrong
"""What can go wrong with the store, as the rest of the program sees it, under one base class. Loads no driver."""


class StorageError(Exception):
    """The base of everything that the store itself raises."""


class DatabaseBusy(StorageError):
    """Another writer held the lock for longer than the store waits: nothing was written, a repeat may succeed."""


class StorageUnavailable(StorageError):
    """The database cannot be used now: it is unreachable, read-only, damaged or none, or its disk is full."""


class RawStoreUnavailable(StorageUnavailable):
    """The store that holds raw records beside the database cannot be used now. The message names no secret."""


class DatabaseTooNew(StorageError):
    """The database was written by a newer release of this program."""


class DatabaseTooOld(StorageError):
    """The database is at an earlier revision than what is asked of it, and is only read."""


class ServiceRuns(StorageError):
    """A service uses the database."""


class UnfinishedMigration(StorageError):
    """The database holds the beginning of another's content."""


class TargetInUse(StorageError):
    """The target of a migration holds something else."""


class UnstorableText(StorageError):
    """Text holds a character that the database does not have."""


class DamagedData(StorageError):
    """A stored array does not decode to what was stored."""


class MissingBlob(DamagedData):
    """A store of raw records does not have what a row names."""
