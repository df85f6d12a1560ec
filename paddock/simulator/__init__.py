"""PyBullet world, car, sensors, referee, trace and Gymnasium environments."""

from . import reasons as reasons  # registers its codes
