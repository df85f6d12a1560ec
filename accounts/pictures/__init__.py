"""The picture beside an alias: uploaded, or drawn from the racer's id."""
