"""Brackets that exhaust a recursive parser."""

from tests.hostile.parts import Upload, good_network, pair


def build() -> Upload:
    return pair(good_network(), b'{"action_space":' + b"[" * 40_000 + b"]" * 40_000 + b"}")
