"""A continuous action space that is a list."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata(action_space_type="continuous"))
