"""Tracks as lines: lengths, borders, files and the shapes of the catalogue."""

from . import open_track as open_track  # registers itself with TrackGeometry
from . import reasons as reasons  # registers its codes
