"""Bounds of the rank columns of entries, which order a board."""

# Values of the rank columns of an entry without a score: all above any score.
MOST_DRIVEN = 1_000_000  # more than any race's laps in percent
NOT_CLASSIFIED = 10**12
NO_RESULT = 2 * 10**12
LAST = 2**31 - 1

# So much less the rank column of a score that was driven in a race's live event has: it stands before all others.
LIVE_LEAD = 10**12

# The rank columns of an entry that was drawn for duels: see races.boards.ranking.drawn_rank.
SEEDS = 128  # more than any field has cars
NO_LAP_MS = 2_000_000  # more than any lap lasts
