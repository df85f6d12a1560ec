"""Races of real cars: sessions, measured laps, sensors, timekeepers and guests."""
