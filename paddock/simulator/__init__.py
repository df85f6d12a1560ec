"""PyBullet world, car, sensors, referee, trace and Gymnasium environment. No Django."""

from . import reasons as reasons  # registers its codes
