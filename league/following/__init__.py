"""Racers that a racer follows, and their latest results."""
