"""Something behind the gzip stream."""

from tests.hostile.parts import Upload, car, small_car


def build() -> Upload:
    ((name, content),) = car(small_car())
    return [(name, content + b"#!/bin/sh")]
