"""Five scores where steering and speed are wanted."""

from tests.hostile.parts import Upload, metadata, metadata_dict, network, pair


def build() -> Upload:
    return pair(network(), metadata(**metadata_dict(head="continuous")))
