"""The public page of a racer."""
