"""The API of races, of who is in them, and of the evaluations that were driven for them."""
