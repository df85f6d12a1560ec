"""API tokens of racers."""
