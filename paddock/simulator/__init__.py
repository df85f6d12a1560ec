"""PyBullet world, car, sensors, referee, trace and Gymnasium environment. No Django."""
