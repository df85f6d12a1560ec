"""Something behind the tar's end mark."""

from tests.hostile.parts import Upload, gzip, metadata, small_car, tar


def build() -> Upload:
    content = tar(("agent/model.pb", small_car()), ("model_metadata.json", metadata()))
    return [("model.tar.gz", gzip(content + b"#!/bin/sh" * 100))]
