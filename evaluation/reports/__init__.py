"""A car's report: one press drives a model on many tracks and under a hundred variations of a lap, for its owner.

What is driven and in which chunks is in :mod:`.planning`, the queue of chunks in :mod:`.jobs`, what a report comes to
in :mod:`.grading`.
"""

MOST_IN_CHUNK = 20  # laps that one worker drives in one go
