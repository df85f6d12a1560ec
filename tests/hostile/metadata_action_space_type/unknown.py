"""An unknown kind of action space."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata(action_space_type="hybrid"))
