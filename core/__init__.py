"""The ground floor of the site: what every room stands on, and nothing of racing."""

from . import reasons as reasons  # registers its codes
