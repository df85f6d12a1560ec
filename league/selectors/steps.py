"""The first steps of a racer, each ticked off by what is in the database."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta

from django.db.models import Exists, OuterRef

from accounts.models import Racer
from evaluation.models import TrainedModel
from races.models import Entry, Race, RaceKind, Submission
from races.selectors.boards import CLASSIFIED

NEWCOMER_FOR = timedelta(days=60)


@dataclass(frozen=True)
class FirstSteps:
    """What a racer has done so far: got a car, sent one to a race, got onto a board with a place, raced in the
    league."""

    has_car: bool
    has_sent: bool
    has_place: bool
    in_league: bool

    @property
    def done(self) -> int:
        """How many of the four."""
        return sum((self.has_car, self.has_sent, self.has_place, self.in_league))


def first_steps(racer: Racer, now: datetime) -> FirstSteps | None:
    """How far a racer has come; None for who has done all of them or has raced for long: one query or none."""
    if racer.is_house or now - racer.joined_at > NEWCOMER_FOR:
        return None
    entries = Entry.objects.filter(racer=OuterRef("pk"))
    sent = Submission.objects.filter(entry__racer=OuterRef("pk"))
    found = Racer.objects.filter(pk=racer.pk).values_list(
        Exists(TrainedModel.objects.filter(owner=OuterRef("pk"))),
        Exists(sent),
        Exists(entries.filter(CLASSIFIED)),
        Exists(sent.filter(entry__race__kind=RaceKind.LEAGUE)),
    )
    steps = FirstSteps(*found.get())
    return None if steps.done == 4 else steps


def league_race_now(races: list[Race]) -> Race | None:
    """The first race of the league among these."""
    return next((race for race in races if race.kind == RaceKind.LEAGUE), None)
