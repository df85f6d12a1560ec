"""Marks from laps: rules for passing, lateness, the calculation. Pure: knows no database."""
