# ruff: noqa: N818 - the names say what is wrong
"""What can go wrong with the store, as the rest of the program sees it, under one base class. Loads no driver."""


class StorageError(Exception):
    """Base class of all errors that the storage itself raises."""


class DatabaseBusy(StorageError):
    """Another writer held the lock for too long: nothing was written, and a repeat may succeed."""


class StorageUnavailable(StorageError):
    """The database cannot be used now: it is unreachable, read-only, damaged or no database, or its disk is full."""


class RawStoreUnavailable(StorageUnavailable):
    """The store that holds raw records beside the database cannot be used now. The message names no secret."""


class DatabaseTooNew(StorageError):
    """The database was written by a newer release of this program."""


class DatabaseTooOld(StorageError):
    """The database, opened read-only, is at an earlier revision than the query needs."""


class ServiceRuns(StorageError):
    """A service uses the database."""


class UnfinishedMigration(StorageError):
    """The database holds an incomplete copy of another database."""


class TargetInUse(StorageError):
    """The target of a migration already has other content."""


class UnstorableText(StorageError):
    """Text holds a character that the database cannot store."""


class DamagedData(StorageError):
    """Stored data fail their checksum or cannot be decoded."""


class MissingBlob(DamagedData):
    """A store of raw records lacks a blob that a row names."""
