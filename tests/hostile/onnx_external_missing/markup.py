"""A file whose name is markup."""

from tests.hostile.parts import Upload, outside


def build() -> Upload:
    return outside({"location": "<img src=x>"}, bytes(20))
