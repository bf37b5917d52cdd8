"""Blobs as objects of a bucket that speaks S3. Credentials, region and endpoint are those of the environment (AWS_*).

A request that is answered has stored the whole object or nothing; S3 is consistent when it is read after that
(https://docs.aws.amazon.com/AmazonS3/latest/userguide/Welcome.html#ConsistencyModel).
"""

import logging
import os
from collections.abc import Callable, Iterator
from datetime import timedelta
from importlib.util import find_spec
from typing import TypeVar

from storage.blobs.store import MARK
from storage.engine.errors import MissingBlob, RawStoreUnavailable

#: Seconds until a connection stands, and until a request is answered (1 GiB at 10 MB/s); how often and how long [s] one that
#: failed is repeated, so that a post is answered within some ten seconds. Chosen; no table.
_CONNECT_SECONDS, _REQUEST_SECONDS = 3, 110
_RETRIES, _RETRY_SECONDS = 2, 6
_EXTRA = "objects"

_log = logging.getLogger("clutchlife")
_Answer = TypeVar("_Answer")


class ObjectStore:
    """A bucket, or what begins with a prefix in it. Made by `opening`; RawStoreUnavailable where no client is installed."""

    def __init__(self, bucket: str, prefix: str) -> None:
        if find_spec("obstore") is None:
            raise RawStoreUnavailable(
                f"raw records in s3://{bucket} need a client that is not installed: install clutchlife[{_EXTRA}]"
            )
        from obstore.store import S3Store  # start-up time, optional package

        self._name = f"s3://{bucket}/{prefix}".rstrip("/")
        plain = os.environ.get("AWS_ENDPOINT_URL_S3", os.environ.get("AWS_ENDPOINT_URL", "")).startswith("http://")
        self._store = S3Store(
            bucket,
            prefix=prefix or None,
            client_options={
                "allow_http": plain,
                "connect_timeout": f"{_CONNECT_SECONDS}s",
                "timeout": f"{_REQUEST_SECONDS}s",
            },
            retry_config={"max_retries": _RETRIES, "retry_timeout": timedelta(seconds=_RETRY_SECONDS)},
        )

    @property
    def address(self) -> str:
        """Where it is."""
        return self._name

    def put(self, name: str, data: bytes | bytearray) -> None:
        """Put an object, in place of one of that name, in one request."""
        import obstore  # start-up time, optional package

        self._request(lambda: obstore.put(self._store, name, bytes(data), use_multipart=False))

    def get(self, name: str) -> bytes:
        """The bytes of an object."""
        data = self._bytes_of(name)
        if data is None:
            self._require_mark()
            raise MissingBlob(f"there is no blob {name} in {self.address}")
        return data

    def exists(self, name: str) -> bool:
        """Whether there is such an object."""
        import obstore  # start-up time, optional package

        try:
            self._request(lambda: obstore.head(self._store, name), absent=True)
        except FileNotFoundError:
            self._require_mark()
            return False
        return True

    def names(self) -> Iterator[tuple[str, float]]:
        """All objects but the mark, by the time of their last change."""
        import obstore  # start-up time, optional package

        pages = iter(obstore.list(self._store))
        while (page := self._request(lambda: next(pages, None))) is not None:
            for item in page:
                if item["path"] != MARK:
                    yield item["path"], item["last_modified"].timestamp()

    def delete(self, name: str) -> None:
        """Remove an object."""
        import obstore  # start-up time, optional package

        self._request(lambda: obstore.delete(self._store, name))

    def mark(self) -> str | None:
        """The content of the mark's object."""
        data = self._bytes_of(MARK)
        return None if data is None else data.decode()

    def set_mark(self, mark: str) -> None:
        """Put the mark's object; the bucket must be there."""
        self.put(MARK, mark.encode())

    def _bytes_of(self, name: str) -> bytes | None:
        import obstore  # start-up time, optional package

        try:
            return bytes(self._request(lambda: obstore.get(self._store, name).bytes(), absent=True))
        except FileNotFoundError:
            return None

    def _require_mark(self) -> None:
        if self._bytes_of(MARK) is None:
            raise RawStoreUnavailable(
                f"{self.address} is no store of raw records, or there is no such bucket: it has no object {MARK}"
            )

    def _request(self, request: Callable[[], _Answer], *, absent: bool = False) -> _Answer:
        """What the request gives; the client's errors as the store's own, but for what is `absent` where that is expected.

        What the client says may be long: the log has it, the error one line.
        """
        from obstore.exceptions import (  # start-up time, optional package
            BaseError,
            PermissionDeniedError,
            UnauthenticatedError,
        )

        try:
            return request()
        except FileNotFoundError as error:
            if absent:
                raise
            raise RawStoreUnavailable(f"{self.address} cannot be used: there is no such bucket") from error
        except (PermissionDeniedError, UnauthenticatedError) as error:
            raise RawStoreUnavailable(f"{self.address} cannot be used: it refuses these credentials") from error
        except (BaseError, OSError) as error:
            _log.warning("%s: %s", self.address, " ".join(str(error).split())[:1000])
            raise RawStoreUnavailable(f"{self.address} cannot be used: it does not answer as a store does") from error
