"""What an authenticator app does (RFC 6238), written down once more: the site's own code is not asked."""

from __future__ import annotations

import hmac
import struct
import time
from base64 import b32decode


def code_of(secret: str) -> str:
    """The six digits that an app shows now for a secret in Base32."""
    counter = struct.pack(">Q", int(time.time()) // 30)
    digest = hmac.digest(b32decode(secret), counter, "sha1")
    start = digest[-1] & 15
    return f"{(struct.unpack('>I', digest[start : start + 4])[0] & 0x7FFFFFFF) % 1_000_000:06d}"
