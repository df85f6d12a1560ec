"""A megabyte of blanks."""

from tests.hostile.parts import Upload, small_car, training_folder


def build() -> Upload:
    return training_folder({7: small_car()}, b"{" + b" " * 1_000_000 + b"}")
