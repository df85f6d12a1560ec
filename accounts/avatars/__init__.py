"""The picture beside an alias: an uploaded one, or one that is drawn from the racer's id."""
