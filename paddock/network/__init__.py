"""Reads, normalises, writes and exactly computes the network of a model."""

# No Django and no runtime: the policy process and the admission use it. :mod:`paddock.packages.gate` decides what a
# network may contain.

from . import reasons as reasons  # registers its codes
