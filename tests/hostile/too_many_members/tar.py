"""One member more than is allowed, each of them harmless."""

from tests.hostile.parts import Upload, regular, with_files

LIMITS = {"archive_members": 1_000}


def build() -> Upload:
    return with_files(*(regular(f"._{number}", b"") for number in range(999)))
