"""Replays of runs: their data, which runs play together, and the page of the viewer."""
