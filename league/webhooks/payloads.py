"""The events that webhooks receive, and their payloads."""

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from urllib.parse import urlsplit

from django.conf import settings
from django.utils.translation import gettext as _
from django.utils.translation import gettext_noop

from core.events import Event
from core.times import clock
from evaluation.models import Evaluation, State
from evaluation.running.events import RUN_FAILED, RUN_FINISHED
from races import events as of_races
from races.models import Entry, Race, TimedSession
from races.web.names import named

from .. import events as of_league
from ..models import Round
from ..notices.kinds import KINDS as NOTICE_KINDS
from ..standings.selectors.outcomes import holds

DISCORD, SLACK = "Discord", "Slack"
# Hosts of the addresses that they hand out (Discord: "Execute Webhook"; Slack: "Incoming webhooks").
HOSTS = {
    "discord.com": DISCORD,
    "discordapp.com": DISCORD,
    "ptb.discord.com": DISCORD,
    "canary.discord.com": DISCORD,
    "hooks.slack.com": SLACK,
    "hooks.slack-gov.com": SLACK,
}
MOST_DISCORD = 2000
_MARKS = re.compile(r"([\\*_~`|>#\[\]()<-])")


def chat_of(url: str) -> str | None:
    """Which chat an address belongs to; None for a program's."""
    parts = urlsplit(url)
    chat = HOSTS.get((parts.hostname or "").removesuffix("."))
    # Discord takes Slack's form at a separate address
    return SLACK if chat == DISCORD and parts.path.rstrip("/").endswith("/slack") else chat


def chat_message(chat: str, words: str, link: str) -> bytes:
    """The body that a chat takes. Whatever a racer or a race is called, it marks nothing up and calls nobody."""
    if chat == DISCORD:
        plain = _MARKS.sub(r"\\\1", words)
        return json.dumps({"content": f"{plain}\n{link}"[:MOST_DISCORD], "allowed_mentions": {"parse": []}}).encode()
    text = words.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return json.dumps({"text": f"{text}\n{link}"}).encode()


# Payload types have the names of their events.
OF_RACE_KINDS = (of_races.RACE_OPENED, of_races.RACE_CLOSED, of_races.RACE_OFFICIAL, of_races.RACE_RESULT)
OF_RACER_KINDS = (RUN_FINISHED, RUN_FAILED, of_league.PROMOTED, of_league.IN_FINALE, of_league.QUALIFIED)
KINDS = (*OF_RACER_KINDS, *OF_RACE_KINDS)
OPENED, CLOSED, OFFICIAL, RESULT = OF_RACES = tuple(kind.name for kind in OF_RACE_KINDS)
FINISHED, FAILED, PROMOTED, IN_FINALE, QUALIFIED = OF_RACER = tuple(kind.name for kind in OF_RACER_KINDS)
EVENTS = (*OF_RACER, *OF_RACES)
# asked for by the owner
TEST = "webhook.test"
LABELS = {
    FINISHED: gettext_noop("my car has finished its run"),
    FAILED: gettext_noop("my run ended without a result"),
    PROMOTED: gettext_noop("I am promoted"),
    IN_FINALE: gettext_noop("I am in the finale"),
    QUALIFIED: gettext_noop("I have qualified for the championship"),
    OPENED: gettext_noop("a race of mine opens"),
    CLOSED: gettext_noop("a race of mine closes"),
    OFFICIAL: gettext_noop("its results are official"),
    RESULT: gettext_noop("a car set a time in it"),
}
# Words for people, for addresses of chats.
WORDS = {
    **{kind.webhook: kind.sentence for kind in NOTICE_KINDS.values() if kind.webhook},
    CLOSED: gettext_noop("%(race)s has closed."),
    RESULT: gettext_noop("%(race)s: %(racer)s was timed (%(time)s)."),
    FINISHED: gettext_noop("Your car %(model)s has finished: best lap %(time)s."),
    FAILED: gettext_noop("The run of your car %(model)s ended without a result (%(reason)s)."),
    IN_FINALE: gettext_noop("You are in the finale: %(race)s."),
    TEST: gettext_noop("Test from Paddock: this address receives the events you chose."),
}


# What happened, by name.
PayloadData = dict[str, str | int | bool | None]


@dataclass(frozen=True)
class Happening:
    """An event ``at`` a time. ``about`` identifies it; ``path`` is its page's."""

    event: str
    about: str
    at: datetime
    path: str = ""
    race: Race | None = None
    data: PayloadData = field(default_factory=dict)

    def body(self) -> dict[str, object]:
        """The body for a program (Standard Webhooks: type, timestamp, data)."""
        return {
            "type": self.event,
            "timestamp": self.at.isoformat(),
            "event": self.event,  # as before there was a "type"
            "race": self._race(),
            "data": self.data,
        }

    def words(self) -> str:
        """The sentence for a chat, in the active language."""
        best, shown = self.data.get("best_lap_ms"), ("racer", "model", "reason")
        params = {
            "race": named(self.race.name) if self.race else "–",
            "time": clock(best if isinstance(best, int) else None),
            "season": named(str(self.data.get("season", "–"))),
            **{name: self.data.get(name, "–") for name in shown},
        }
        return _(WORDS[self.event]) % params

    def _race(self) -> dict[str, str] | None:
        if self.race is None:
            return None
        return {
            "slug": self.race.slug,
            "name": self.race.name,
            "url": f"{settings.SITE_URL}{self.race.get_absolute_url()}",
            "opens_at": self.race.opens_at.isoformat(),
            "closes_at": self.race.closes_at.isoformat(),
        }


def _timed(event: Event) -> Happening | None:
    race = _race(event.race)
    return None if race is None else Happening(event.kind, event.once or "", event.at, race.get_absolute_url(), race)


def _official(event: Event) -> Happening | None:
    """Of rounds, as long as they are."""
    race = _race(event.race)
    is_round = race is not None and Round.objects.filter(race=race, closed_at=event.at).exists()
    return _timed(event) if is_round else None


def _run(event: Event) -> Evaluation | None:
    """The run of an event. One that was driven again is no news."""
    runs = Evaluation.objects.filter(public_id=event.subject, redrive=None, state__in=(State.FINISHED, State.FAILED))
    return runs.select_related("model", "result", "submission__entry__race", "duel__race").first()


def _ended(run: Evaluation) -> datetime:
    assert run.ended_at is not None, "it is finished or has failed"
    return run.ended_at


def _counted(event: Event) -> Happening | None:
    """A car was timed in a race; a result that is held back is sent once it counts."""
    run = _run(event)
    submission = None if run is None else getattr(run, "submission", None)
    if run is None or submission is None or run.state != State.FINISHED:
        return None
    entry = submission.entry
    data = _standing(entry, is_best=entry.best_id == submission.pk)
    data = {"evaluation": run.public_id, "racer": entry.racer.alias, **data}
    return Happening(RESULT, run.public_id, _ended(run), run.get_absolute_url(), _race(entry.race_id), data)


def _timed_session(event: Event) -> Happening | None:
    """A session with a real car has ended in a race: sent as a timed car."""
    sessions = TimedSession.objects.filter(pk=event.data["session"], discarded_at=None, ended_at__isnull=False)
    session = sessions.select_related("entry__racer", "race").first()
    if session is None or session.ended_at is None:
        return None
    entry = session.entry
    data = _standing(entry, is_best=entry.best_session_id == session.pk)
    data = {"session": str(session.pk), "racer": entry.shown_name, **data}
    path = session.race.get_absolute_url()
    return Happening(RESULT, str(session.pk), session.ended_at, path, _race(session.race_id), data)


def _driven(event: Event) -> Happening | None:
    """What one's own car has driven: in a race, in a duel, or in private."""
    run = _run(event)
    if run is None:
        return None
    submission, duel = getattr(run, "submission", None), getattr(run, "duel", None)
    race = submission.entry.race if submission else duel.race if duel else None
    data: PayloadData = {"evaluation": run.public_id, "model": run.model.name}
    if run.state == State.FAILED:
        kind, data = FAILED, data | {"reason": run.reason_code}
    else:
        kind = FINISHED
        data |= {"best_lap_ms": run.result.best_lap_ms, "total_ms": run.result.total_ms}
        if submission:
            data |= {"is_best": submission.entry.best_id == submission.pk}
    return Happening(kind, run.public_id, _ended(run), run.get_absolute_url(), race, data)


def _moved_on(event: Event) -> Happening | None:
    """The official outcome of a round for a racer; ``about`` the season or month, so that it is sent once."""
    rounds = Round.objects.filter(pk=event.data["round"], closed_at__isnull=False, race__imported_at=None)
    one = rounds.select_related("race", "season").first()
    if one is None or one.closed_at is None or not holds(event):
        return None
    about = one.race.slug if event.kind == IN_FINALE else one.season.slug
    path = one.season.get_absolute_url() + ("" if event.kind == PROMOTED else "finales/")
    return Happening(event.kind, about, one.closed_at, path, one.race, {"season": one.season.name})


def _race(pk: int | None) -> Race | None:
    return Race.objects.filter(pk=pk, cancelled_at=None, imported_at=None).first()


def _standing(entry: Entry, *, is_best: bool) -> PayloadData:
    values = {"classified": entry.classified, "score_ms": entry.score_ms, "best_lap_ms": entry.best_lap_ms}
    return {"is_best": is_best, **values}


# Makes the payload of an event, by its kind; None if it no longer holds.
PAYLOADS: dict[str, Callable[[Event], Happening | None]] = {
    OPENED: _timed,
    CLOSED: _timed,
    OFFICIAL: _official,
    RESULT: _counted,
    of_races.RACE_TIMED.name: _timed_session,
    FINISHED: _driven,
    FAILED: _driven,
    PROMOTED: _moved_on,
    IN_FINALE: _moved_on,
    QUALIFIED: _moved_on,
}
