"""A good archive with more behind it than an upload may have."""

from tests.hostile.parts import Upload, car, small_car

LIMITS = {"upload_bytes": 16 << 20}


def build() -> Upload:
    [(name, content)] = car(small_car())
    return [(name, content + bytes(16 << 20))]
