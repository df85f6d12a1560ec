"""The ground floor of the site, without any domain."""

from . import reasons as reasons  # registers its codes
