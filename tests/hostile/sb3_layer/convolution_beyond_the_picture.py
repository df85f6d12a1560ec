"""Convolutions larger than the picture."""

from tests.hostile.parts import Upload
from tests.hostile.policies import policy, torch, weights


def build() -> Upload:
    sizes = {"0": (2, 1, 500, 500), "2": (2, 2, 4, 4), "4": (2, 2, 3, 3)}
    eyes = {f"features_extractor.cnn.{place}.weight": torch().zeros(size) for place, size in sizes.items()}
    eyes |= {f"features_extractor.cnn.{place}.bias": torch().zeros(2) for place in sizes}
    dense = {
        "features_extractor.linear.0.weight": torch().zeros(4, 8),
        "features_extractor.linear.0.bias": torch().zeros(4),
    }
    return policy(weights(action_net__weight=torch().zeros(5, 4)) | eyes | dense)
