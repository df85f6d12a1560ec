"""Two networks of one name in a tar."""

from tests.hostile.parts import Upload, regular, with_files


def build() -> Upload:
    return with_files(regular("agent/model.pb", b"other"))
