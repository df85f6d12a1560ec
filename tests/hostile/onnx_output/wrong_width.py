"""Five scores for six actions."""

from tests.hostile.parts import Upload, metadata, metadata_dict, network, pair


def build() -> Upload:
    return pair(network(), metadata(**metadata_dict(actions=6)))
