"""What a webhook may be told of: what happens to its owner's cars, and in the races that they organise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from django.conf import settings
from django.db.models import F, Q, QuerySet
from django.utils.translation import gettext as _
from django.utils.translation import gettext_noop

from accounts.models import Racer
from evaluation.models import Evaluation, State
from races.facts import clock
from races.models import Kind, Race
from races.names import named

from .models import ChampionshipPlace, FinalePlace, Membership, NoticeKind, Stage, Webhook
from .notices import SENTENCES

OPENED, CLOSED, OFFICIAL, RESULT = "race.opened", "race.closed", "race.official", "race.result"
FINISHED, FAILED = "run.finished", "run.failed"
PROMOTED, IN_FINALE, QUALIFIED = "racer.promoted", "racer.finale", "racer.qualified"
OF_RACES = (OPENED, CLOSED, OFFICIAL, RESULT)
OF_RACER = (FINISHED, FAILED, PROMOTED, IN_FINALE, QUALIFIED)
EVENTS = (*OF_RACER, *OF_RACES)
# asked for by the owner
TEST = "webhook.test"
LABELS = {
    FINISHED: gettext_noop("a car of mine has driven"),
    FAILED: gettext_noop("a run of mine came to no result"),
    PROMOTED: gettext_noop("I am promoted"),
    IN_FINALE: gettext_noop("I am in a finale"),
    QUALIFIED: gettext_noop("I have qualified for the championship"),
    OPENED: gettext_noop("a race of mine opens"),
    CLOSED: gettext_noop("a race of mine closes"),
    OFFICIAL: gettext_noop("its results are official"),
    RESULT: gettext_noop("a car was timed in it"),
}
# Words for people, for addresses of chats.
WORDS = {
    OPENED: SENTENCES[NoticeKind.OPENS],
    CLOSED: gettext_noop("%(race)s has closed."),
    OFFICIAL: SENTENCES[NoticeKind.OFFICIAL],
    RESULT: gettext_noop("%(race)s: %(racer)s was timed (%(time)s)."),
    FINISHED: gettext_noop("Your car %(model)s has driven: best lap %(time)s."),
    FAILED: gettext_noop("The run of your car %(model)s came to no result (%(reason)s)."),
    PROMOTED: SENTENCES[NoticeKind.PROMOTED],
    IN_FINALE: gettext_noop("You are in the finale: %(race)s."),
    QUALIFIED: SENTENCES[NoticeKind.QUALIFIED],
    TEST: gettext_noop("A test from Paddock: this address is told what you chose."),
}


@dataclass(frozen=True)
class Happening:
    """One thing that happened ``at`` a time. ``about`` says what makes it the same thing; ``path`` is its page's."""

    event: str
    about: str
    at: datetime
    path: str = ""
    race: Race | None = None
    data: dict[str, Any] = field(default_factory=dict)

    def body(self) -> dict[str, Any]:
        """What a program is told (Standard Webhooks: type, timestamp, data)."""
        return {
            "type": self.event,
            "timestamp": self.at.isoformat(),
            "event": self.event,  # as before there was a "type"
            "race": self._race(),
            "data": self.data,
        }

    def words(self) -> str:
        """What people in a chat are told, in the active language."""
        said = {
            "race": named(self.race.name) if self.race else "–",
            "time": clock(self.data.get("best_lap_ms")),
            "season": named(self.data.get("season", "–")),
            **{name: self.data.get(name, "–") for name in ("racer", "model", "reason")},
        }
        return _(WORDS[self.event]) % said

    def _race(self) -> dict[str, Any] | None:
        if self.race is None:
            return None
        return {
            "slug": self.race.slug,
            "name": self.race.name,
            "url": f"{settings.SITE_URL}{self.race.get_absolute_url()}",
            "opens_at": self.race.opens_at.isoformat(),
            "closes_at": self.race.closes_at.isoformat(),
        }


def happenings(hook: Webhook, since: datetime, now: datetime) -> Iterator[Happening]:
    """What the webhook is to be told of the time after ``since`` until ``now``."""
    wanted = set(hook.events or EVENTS)
    if wanted & set(OF_RACES):
        for one in _of_races(_organised(hook), since, now):
            if one.event in wanted:
                yield one
    if wanted & {FINISHED, FAILED}:
        for one in _runs(hook, since, now):
            if one.event in wanted:
                yield one
    for event in (PROMOTED, IN_FINALE, QUALIFIED):
        if event in wanted:
            yield from _outcomes(event, hook, since, now)


def _organised(hook: Webhook) -> QuerySet[Race]:
    """The races that a webhook may be told of, judged anew each time: who no longer organises hears no more."""
    races = Race.objects.filter(cancelled_at=None, imported_at=None)
    if not hook.owner.is_staff:
        races = races.filter(organiser=hook.owner)
    elif hook.race_id is None:
        races = races.filter(Q(organiser=hook.owner) | Q(kind=Kind.LEAGUE))
    return races if hook.race_id is None else races.filter(pk=hook.race_id)


def _of_races(races: QuerySet[Race], since: datetime, now: datetime) -> Iterator[Happening]:
    for race in races.filter(opens_at__gt=since, opens_at__lte=now):
        about = f"{race.slug}:{race.opens_at:%Y%m%d%H%M}"
        yield Happening(OPENED, about, race.opens_at, race.get_absolute_url(), race)
    for race in races.filter(closes_at__gt=since, closes_at__lte=now):
        about = f"{race.slug}:{race.closes_at:%Y%m%d%H%M}"
        yield Happening(CLOSED, about, race.closes_at, race.get_absolute_url(), race)
    for race in races.filter(round__closed_at__gt=since, round__closed_at__lte=now).select_related("round"):
        about = f"{race.slug}:{race.round.closed_at:%Y%m%d%H%M%S}"
        yield Happening(OFFICIAL, about, race.round.closed_at, race.get_absolute_url(), race)
    # what was driven again is no news, and what is held back is told once it counts
    ended = Evaluation.objects.filter(
        submission__entry__race__in=races,
        redrive=None,
        result__engine=F("submission__entry__race__engine"),
        ended_at__gt=since,
        ended_at__lte=now,
        state=State.FINISHED,
    )
    for one in ended.select_related("submission__entry__race", "submission__entry__racer").order_by("ended_at", "pk"):
        entry = one.submission.entry
        data = {"evaluation": one.public_id, "racer": entry.racer.alias} | _standing(one)
        yield Happening(RESULT, one.public_id, one.ended_at, one.get_absolute_url(), entry.race, data)


def _runs(hook: Webhook, since: datetime, now: datetime) -> Iterator[Happening]:
    """What the owner's own cars have driven: in races, in duels, and in private."""
    ended = Evaluation.objects.filter(
        owner=hook.owner, redrive=None, ended_at__gt=since, ended_at__lte=now, state__in=[State.FINISHED, State.FAILED]
    )
    if hook.race_id is not None:
        ended = ended.filter(Q(submission__entry__race=hook.race_id) | Q(duel__race=hook.race_id))
    related = ("model", "result", "submission__entry__race", "duel__race")
    for one in ended.select_related(*related).order_by("ended_at", "pk"):
        submission, duel = getattr(one, "submission", None), getattr(one, "duel", None)
        race = submission.entry.race if submission else duel.race if duel else None
        data: dict[str, Any] = {"evaluation": one.public_id, "model": one.model.name}
        if one.state == State.FAILED:
            event, data = FAILED, data | {"reason": one.reason_code}
        else:
            event = FINISHED
            data |= {"best_lap_ms": one.result.best_lap_ms, "total_ms": one.result.total_ms}
            if submission:
                data |= {"is_best": submission.entry.best_id == submission.pk}
        yield Happening(event, one.public_id, one.ended_at, one.get_absolute_url(), race, data)


def _outcomes(event: str, hook: Webhook, since: datetime, now: datetime) -> Iterator[Happening]:
    """What came of a round for the owner, once it is official. ``about``: of the season or of the month, as a round
    that is opened again and closed anew tells nothing twice."""
    owner: Racer = hook.owner
    rounds = {"closed_at__gt": since, "closed_at__lte": now, "race__imported_at": None}
    if hook.race_id is not None:
        rounds["race"] = hook.race_id
    if event == PROMOTED:
        rows = Membership.objects.filter(racer=owner, **{f"promoted_in__{name}": rounds[name] for name in rounds})
        found = [row.promoted_in for row in rows.select_related("promoted_in__race", "promoted_in__season")]
    else:
        kind, stage = (FinalePlace, Stage.PRO) if event == IN_FINALE else (ChampionshipPlace, Stage.FINALE)
        rows = kind.objects.filter(
            racer=owner, round__stage=stage, **{f"round__{name}": rounds[name] for name in rounds}
        )
        found = [row.round for row in rows.select_related("round__race", "round__season")]
    for one in found:
        about = one.race.slug if event == IN_FINALE else one.season.slug
        path = one.season.get_absolute_url() + ("" if event == PROMOTED else "finales/")
        yield Happening(event, about, one.closed_at, path, one.race, {"season": one.season.name})


def _standing(evaluation: Evaluation) -> dict[str, Any]:
    entry = evaluation.submission.entry
    return {
        "is_best": entry.best_id == evaluation.submission.pk,
        "classified": entry.classified,
        "score_ms": entry.score_ms,
        "best_lap_ms": entry.best_lap_ms,
    }
