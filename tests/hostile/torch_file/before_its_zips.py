"""What torch wrote before it wrote zips: pickles one after the other."""

from tests.hostile.parts import Upload, metadata

MAGIC = b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19."


def build() -> Upload:
    return [("car.pth", MAGIC + b"\x80\x02M\xe9\x03."), ("model_metadata.json", metadata())]
