"""Pages of races: the list, one race with its board, organising, entering."""
