"""Attempts: hand in, give back, run ends, draws of hidden tracks."""
