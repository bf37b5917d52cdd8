"""Places for blobs: a folder, and a bucket of a server that speaks S3 over HTTP."""

import secrets
from collections.abc import Iterator
from contextlib import contextmanager

import httpx2
import pytest

from storage.blobs.stores import open_store

CREDENTIALS = {"AWS_ACCESS_KEY_ID": "an id", "AWS_SECRET_ACCESS_KEY": "a-very-secret-key", "AWS_REGION": "us-east-1"}


@contextmanager
def s3_server() -> Iterator[str]:
    """The address of a server."""
    from moto.server import ThreadedMotoServer  # 0.7 s for whoever starts one, not for every collection

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    try:
        yield f"http://{host}:{port}"
    finally:
        server.stop()


def use_endpoint(monkeypatch: pytest.MonkeyPatch, endpoint: str) -> None:
    """Have stores that are opened from now on ask this server."""
    for name, value in (CREDENTIALS | {"AWS_ENDPOINT_URL": endpoint}).items():
        monkeypatch.setenv(name, value)
    open_store.cache_clear()


def new_bucket(endpoint: str) -> str:
    """The address of a new store."""
    bucket = f"raw-{secrets.token_hex(4)}"
    httpx2.put(f"{endpoint}/{bucket}").raise_for_status()
    return f"s3://{bucket}/of/clutches"
