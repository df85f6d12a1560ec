"""A visitor drives a car on a track in the browser, for fun: no time of it is kept."""
