"""What a car sees while it is trained, as a row keeps it and a page shows it."""

from __future__ import annotations

import base64
import struct
import zlib
from typing import Any

from ..trainer.messages import SIGHT_COLUMNS, SIGHT_ROWS, Sight


def told_sight(sight: Sight) -> dict[str, Any]:
    """``{"png": base64, "steering", "speed", "value"}``."""
    about = {"steering": sight.steering, "speed": sight.speed, "value": sight.value}
    return {"png": base64.b64encode(_png(sight.picture)).decode(), **about}


def _png(picture: bytes) -> bytes:
    """The grey bytes as a PNG. Written here, where a stranger's process has no hand in it but for the greys."""
    rows = b"".join(
        b"\0" + picture[start : start + SIGHT_COLUMNS] for start in range(0, SIGHT_ROWS * SIGHT_COLUMNS, SIGHT_COLUMNS)
    )
    head = struct.pack(">IIBBBBB", SIGHT_COLUMNS, SIGHT_ROWS, 8, 0, 0, 0, 0)
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(rows, 1)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in parts)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
