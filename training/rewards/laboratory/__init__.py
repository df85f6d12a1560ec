"""The reward laboratory: a recorded lap, rewards along it, heat maps."""
