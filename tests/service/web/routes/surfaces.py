"""Inspections and photographs to post."""

import hashlib
import struct
import zlib
from typing import Any

from fastapi.testclient import TestClient

FRESH = {"cycles": 0, "roughness_um": 9.52, "skewness": -0.87}
WORN = {
    "cycles": 11000,
    "performed_at": "2026-11-02T08:00:00+01:00",
    "lining": "disc 2, side A",
    "roughness_um": 1.94,
    "skewness": -3.4,
    "note": "smooth and flat",
}


def png(red: int = 120, size: int = 8) -> bytes:
    """A square PNG of one colour."""
    rows = b"".join(b"\0" + bytes((red, 90, 60)) * size for _ in range(size))
    parts = {b"IHDR": struct.pack(">IIBBBBB", size, size, 8, 2, 0, 0, 0), b"IDAT": zlib.compress(rows), b"IEND": b""}
    chunks = (
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in parts.items()
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


#: The beginnings of the other two kinds of file: enough to be stored as one.
JPEG, WEBP = b"\xff\xd8\xff\xe0 a picture", b"RIFF\x10\0\0\0WEBPVP8 "


def sha256(content: bytes) -> str:
    """The name of a photograph."""
    return hashlib.sha256(content).hexdigest()


def inspected(client: TestClient, body: dict[str, Any] = WORN, clutch_id: str = "c1") -> str:
    """Post an inspection; its address."""
    answer = client.post(f"/v1/clutches/{clutch_id}/inspections", json=body)
    assert answer.status_code == 201, answer.text
    return answer.headers["location"]
