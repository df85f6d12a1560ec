"""Ten thousand members, each allowed."""

from tests.hostile.parts import Upload, regular, with_files


def build() -> Upload:
    return with_files(*(regular(f"._{number}", b"") for number in range(10_000)))
