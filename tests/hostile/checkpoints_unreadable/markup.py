"""The best checkpoint is markup."""

from tests.hostile.parts import Upload, small_car, training_folder


def build() -> Upload:
    return training_folder({7: small_car()}, b'{"best_checkpoint": {"name": "<script>13</script>"}}')
