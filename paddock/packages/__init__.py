"""Reads, checks, converts and exports model packages."""

from . import reasons as reasons  # registers its codes
