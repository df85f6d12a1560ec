"""Pages of races and of evaluations."""
