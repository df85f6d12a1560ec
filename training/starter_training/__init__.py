"""A first car with one click."""
