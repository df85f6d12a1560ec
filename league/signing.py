"""How deliveries are signed: the scheme of Standard Webhooks (standardwebhooks.com, specification 1.0)."""

from __future__ import annotations

import hashlib
import hmac
from base64 import b64decode, b64encode
from collections.abc import Iterable
from datetime import datetime

PREFIX = "whsec_"


def shown(secret: str) -> str:
    """A secret as libraries take it: the prefix tells what it is, the rest is Base64."""
    return PREFIX + secret


def signed_headers(*, secrets: Iterable[str], message: str, now: datetime, body: bytes) -> dict[str, str]:
    """The three headers of a delivery. ``message`` is the same whenever the same thing is tried again; each of the
    ``secrets`` signs, so that a receiver may know the old one or the new one."""
    timestamp = str(int(now.timestamp()))
    signed = b".".join([message.encode(), timestamp.encode(), body])
    signatures = (hmac.new(b64decode(secret), signed, hashlib.sha256).digest() for secret in secrets)
    return {
        "webhook-id": message,
        "webhook-timestamp": timestamp,
        "webhook-signature": " ".join(f"v1,{b64encode(signature).decode()}" for signature in signatures),
    }
