"""Where :mod:`tests.evaluation.held_worker` can stop, in the order of a run."""

POINTS = ("claimed", "running", "stored", "finishing", "committed")
