"""A run as a video."""

from . import reasons as reasons  # registers its codes
