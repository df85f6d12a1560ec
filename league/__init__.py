"""The league: seasons, rounds, divisions, promotion, standings."""

from . import reasons as reasons  # registers its codes
