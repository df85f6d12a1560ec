"""Something behind the zip."""

from tests.hostile.parts import Upload, good_zip


def build() -> Upload:
    ((name, content),) = good_zip()
    return [(name, content + b"#!/bin/sh")]
