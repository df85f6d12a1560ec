"""A tar member that climbs out."""

from tests.hostile.parts import Upload, regular, with_files


def build() -> Upload:
    return with_files(regular("../../etc/cron.d/x", b"x"))
