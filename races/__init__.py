from . import reasons as reasons  # registers its codes
from .boards import ranking as ranking  # registers the ranking methods
