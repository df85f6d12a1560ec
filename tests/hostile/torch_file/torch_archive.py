"""A torch file: a zip with a pickle inside."""

from tests.hostile.parts import Upload, zipped


def build() -> Upload:
    return [("policy.pth", zipped(("archive/data.pkl", b"\x80\x02."), ("archive/version", b"3")))]
