"""How many rows stand where on a board, so that a rank is not counted row by row."""

from django.db import models

from .race import Race

# Buckets of a board's first column, each level's 32 times as wide as the next one's: 17 minutes, 33 seconds, a second,
# 32 ms, a millisecond. A bucket's number is the score shifted right by this many bits. Levels are this narrow so that a
# place is a sum of a few dozen rows on a board of any length; they could be fewer, but fuller where a board is long.
SHIFTS = (20, 15, 10, 5, 0)
LEVEL_BITS = 5
# Two rows of a race are totals instead: of all on its board, and of those with a score to be ranked by.
TOTAL = 63
EVERYBODY, CLASSIFIED = 0, 1


class BoardCount(models.Model):
    """The entries on a race's board in one bucket of ``rank_score``: all ``rows``, and ``racers`` without house cars.

    Triggers (:mod:`races.boards.triggers`) change these rows with each statement that changes an entry.
    """

    race = models.ForeignKey(Race, models.CASCADE, related_name="board_counts", db_index=False)
    shift = models.SmallIntegerField()
    bucket = models.BigIntegerField()
    rows = models.IntegerField(default=0)
    racers = models.IntegerField(default=0)

    class Meta:
        verbose_name = "count of a board"
        verbose_name_plural = "counts of boards"
        constraints = [models.UniqueConstraint(fields=["race", "shift", "bucket"], name="board_count_once_a_bucket")]

    def __str__(self) -> str:
        return f"{self.race_id}: {self.bucket} << {self.shift}: {self.rows}"
