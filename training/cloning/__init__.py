"""Models whose weights a training can start from."""
