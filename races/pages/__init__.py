"""The list of races, the page of a race and what its organiser does."""
