"""A sensor name that is markup."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata(sensor=["<script>alert(1)</script>"]))
