"""Racers that have a page, and their wins and podiums."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Annotated, TypedDict

from django.db.models import Exists, Min, OuterRef, Q, QuerySet
from django.utils.translation import gettext as _

from accounts.following import followers_shown
from accounts.models import Follow, Racer
from accounts.profile.fields import FIELDS, ProfileField, api_field, register
from core.streams.shared_pieces import shared_value
from core.templatetags.formats import month
from evaluation.models import Evaluation, TrainedModel
from evaluation.selectors import shared_models
from races.boards.selectors.board import CLASSIFIED
from races.boards.selectors.counts import places_of
from races.entries.selectors.lists import HistoryRow, organised_by, racer_history
from races.entries.selectors.visibility import races_visible_to
from races.entries.services.submissions import ACTIVE
from races.models import BoardCount, Entry, Opponents, Race, RaceKind, Visibility
from races.models.counting import CLASSIFIED as RANKED
from races.models.counting import TOTAL

from ..cups.selectors import trophies_of
from ..models import CupPlace, Round

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer


# The same as Racer.has_page.
SHOWN = Q(is_active=True) | Q(record_id__isnull=False, guest_name="")


def racer_shown(alias: str, follower: Racer | AnonymousUser | None = None) -> Racer | None:
    """The racer with this alias in any case and their class, if they have a page; ``is_followed`` by ``follower``."""
    follows = Follow.objects.filter(followed=OuterRef("pk"), follower=getattr(follower, "pk", None))
    racers = Racer.objects.select_related("learner__classroom").annotate(is_followed=Exists(follows))
    return racers.filter(SHOWN, alias__iexact=alias).first()


def racing_since(racer: Racer) -> datetime:
    """The day a racer joined; for racers of an imported season, the opening of their first race."""
    if racer.record_id is None:
        return racer.joined_at
    first = Race.objects.filter(entries__racer=racer).aggregate(first=Min("opens_at"))["first"]
    return racer.joined_at if first is None else min(first, racer.joined_at)


LEAST = 2  # classified, for a place to be won against somebody
PODIUM = 3
AT_A_TIME = 500


@dataclass(frozen=True)
class Honours:
    """Official results with two or more classified racers."""

    races: Annotated[int, "All entered."]
    wins: int
    podiums: int
    real_wins: Annotated[int, "With real cars."] = 0
    real_podiums: Annotated[int, "With real cars."] = 0


def honours_of(racer: Racer, seen: QuerySet[Race], now: datetime) -> Honours:
    """What a racer has won in the races ``seen``. Two queries, and one for every 500 races with a result.

    Official are results of closed rounds, and of community races that are over and fully timed, with two or more cars.
    """
    entries = Entry.objects.filter(racer=racer, withdrawn_at=None, race__in=seen.order_by().values("pk"))
    count = entries.count()
    several = BoardCount.objects.filter(race=OuterRef("race"), shift=TOTAL, bucket=RANKED, racers__gte=LEAST)
    won = entries.filter(_official(now), Exists(several), CLASSIFIED, is_baseline=False)
    physical = dict(won.order_by().values_list("pk", "race__physical"))
    ids = list(physical)
    places: dict[bool, list[int]] = {False: [], True: []}
    for begin in range(0, len(ids), AT_A_TIME):
        for entry, place in places_of(ids[begin : begin + AT_A_TIME]).items():
            places[physical[entry]].append(place)
    counts = ((found.count(0), sum(place < PODIUM for place in found)) for found in places.values())
    return Honours(count, *itertools.chain(*counts))


def _official(now: datetime) -> Q:
    """Of an entry: whether its race's results are official."""
    rounds = Round.objects.filter(race=OuterRef("race"))
    waiting = Evaluation.objects.filter(
        submission__entry__race=OuterRef("race"), submission__entry__withdrawn_at=None, state__in=ACTIVE
    )
    community = Q(race__kind=RaceKind.COMMUNITY, race__closes_at__lte=now) & Q(~Exists(waiting))
    community &= Q(race__next_engine="")  # what is driven again may yet change it
    community &= ~Q(race__opponents=Opponents.MODELS) | Q(race__draw__over_at__isnull=False)
    return Q(race__cancelled_at=None) & (Exists(rounds.filter(closed_at__isnull=False)) | community & ~Exists(rounds))


ORGANISED = 10
SHARED = 20

register(
    ProfileField(
        "racing_since",
        lambda racer, viewer: racing_since(racer),
        lambda since: " ".join((_("racing since"), month(since))),
        lambda: api_field("DateTimeField", help_text="The day of joining, or of the first race of an imported season."),
    )
)
register(
    ProfileField(
        "followers",
        lambda racer, viewer: followers_shown(viewer, racer),
        lambda followers: _("followers: %(followers)s") % {"followers": followers} if followers else "",
        lambda: api_field("CharField", allow_blank=True, help_text="Their number, `20+` for more, or empty."),
    )
)


class RacesInProfile(TypedDict):
    """What a racer did in some races. It must not be changed."""

    honours: Honours
    history: list[HistoryRow]
    trophies: list[CupPlace]
    organised: list[Race]


@dataclass(frozen=True)
class Profile:
    """What a viewer sees of a racer. ``fields``: values by the names of :mod:`accounts.profile.fields`; ``private``:
    the ids of the racer's races that are in it and not public."""

    racer: Racer
    fields: dict[str, object]
    honours: Honours
    history: list[HistoryRow]
    trophies: list[CupPlace]
    shared: list[TrainedModel]
    organised: list[Race]
    private: frozenset[int]

    @property
    def texts(self) -> list[str]:
        return [text for name, value in self.fields.items() if (text := FIELDS[name].text(value))]


def profile_of(racer: Racer, viewer: Racer | AnonymousUser, now: datetime) -> Profile:
    """The profile for a viewer, read once a second for all viewers who may see the same of the racer's races."""
    private = _private_seen(racer, viewer)
    seen = races_in_profile(racer, private, now)
    fields = {name: field.value(racer, viewer) for name, field in FIELDS.items()}
    shared = [] if viewer.pk is None else shared_value(("shared models of", racer.pk), lambda: _models_shared_by(racer))
    return Profile(racer, fields, shared=shared, private=private, **seen)


def races_in_profile(racer: Racer, private: frozenset[int], now: datetime) -> RacesInProfile:
    """What a racer did in public races and in those with the ids ``private``."""

    def read() -> RacesInProfile:
        seen = Race.objects.filter(Q(visibility=Visibility.PUBLIC) | Q(pk__in=private))
        return {
            "honours": honours_of(racer, seen, now),
            "history": racer_history(racer, seen),
            "trophies": trophies_of(racer),
            "organised": list(organised_by(racer, seen)[:ORGANISED]),
        }

    return shared_value(("profile", racer.pk, private), read)


def _private_seen(racer: Racer, viewer: Racer | AnonymousUser) -> frozenset[int]:
    """The racer's races that are not public and that the viewer may see: one query, or none if the racer has none."""
    entered = Entry.objects.filter(race=OuterRef("pk"), racer=racer, withdrawn_at=None)
    private = ~Q(visibility=Visibility.PUBLIC) & (Q(organiser=racer) | Exists(entered))
    has_some = shared_value(("has private races", racer.pk), lambda: Race.objects.filter(private).exists())
    if not has_some or viewer.pk is None:
        return frozenset()
    return frozenset(races_visible_to(viewer).order_by().filter(private).values_list("pk", flat=True))


def _models_shared_by(racer: Racer) -> list[TrainedModel]:
    """The same for every reader."""
    return list(shared_models(racer).filter(owner=racer)[:SHARED])
