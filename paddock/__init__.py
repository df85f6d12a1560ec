"""The race engine without Django: tracks, simulator, environments, model packages and networks."""
