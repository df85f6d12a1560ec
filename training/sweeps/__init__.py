"""Sweeps: automatic tuning of a training by successive halving."""
