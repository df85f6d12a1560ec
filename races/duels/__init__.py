"""Races of models against models: pairings, points and ratings. A car is its seed, 1 for the best of qualifying."""
