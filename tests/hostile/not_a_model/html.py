"""Not a network at all: html."""

from tests.hostile.parts import Upload, pair


def build() -> Upload:
    return pair(b"<!DOCTYPE html><html><script>alert(1)</script></html>")
