"""Groups of racers."""
