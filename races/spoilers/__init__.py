"""Results that are hidden from a racer until they have watched the race."""
