"""A run as a film."""

from . import reasons as reasons  # registers its codes
