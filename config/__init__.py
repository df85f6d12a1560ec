"""The Django project."""

from . import reasons as reasons  # registers its codes
