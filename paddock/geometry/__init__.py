"""Tracks as lines: lengths, borders, files and the shapes of the catalogue."""

from . import reasons as reasons  # registers its codes
