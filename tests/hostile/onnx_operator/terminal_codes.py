"""An operator that is not allowed: terminal codes."""

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("\x1b]0;owned\x07", ["row"])
