"""Tracks as lines: lengths, borders, files, and the shapes of the catalogue."""
