"""The engine: tracks, simulator, environments, and what a model's network may be. No Django, and no room of the
site."""
