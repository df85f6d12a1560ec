"""An operator that is not allowed: markup."""

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("<img src=x>", ["row"])
