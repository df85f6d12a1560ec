"""What makes a model the same model."""

from __future__ import annotations

import hashlib

from .metadata import ModelMetadata


def identity(onnx: bytes, metadata: ModelMetadata) -> str:
    """sha-256 of the canonical network, a zero byte, and the metadata that counts (action space and sensors)."""
    digest = hashlib.sha256(onnx)
    digest.update(b"\0" + metadata.canonical_json())
    return digest.hexdigest()
