"""What racers are told of what happened: the reader of events that writes notices.

What happened longer than ``REACH`` ago is not told any more; what came of a round for a racer, longer than
``OUTCOME_REACH`` ago. What an event says is looked at as it is now: a race that is called off does not open.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any

from accounts.events import TEAM_INVITED
from accounts.models import TeamInvitation
from core.events import Event, EventKind, EventReader
from evaluation.events import RUN_FAILED
from evaluation.models import Evaluation, State
from races import events as of_races
from races.measured import counted_laps
from races.models import Entry, Race, RaceKind, Redrive, Retiming, Submission, TimedSession
from races.ranking import laps_needed, longest_streak, standing_in
from races.selectors import podiums
from races.selectors.results import place_of, result_of
from races.selectors.visibility import can_see_evaluation
from races.services.gates import moment

from ..events import CUP_OVER, DISQUALIFIED, IN_FINALE, PROMOTED, QUALIFIED, RESTORED, SEASON_DRAFTED
from ..models import CupPlace, Lead, NoticeKind, Round, Season, StewardDecision
from ..selectors.outcomes import holds
from .followers import tell_of_cup, tell_of_lead, tell_of_win
from .telling import Told, admins_with, concerned, entered, tell

REACH = timedelta(days=3)
OUTCOME_REACH = timedelta(days=30)
A_DAY = timedelta(days=1)
_RETIMED = ("old_score_ms", "old_rank", "new_score_ms", "new_rank")


def _opened(event: Event, now: datetime) -> int:
    race = _race(event)
    if race is None or event.at <= now - REACH or not race.opens_at <= now < race.closes_at:
        return 0
    return _of_its_times(NoticeKind.OPENS, race, event, now)


def _closing(event: Event, now: datetime) -> int:
    race = _race(event)
    if race is None or not now < race.closes_at <= now + A_DAY:
        return 0
    return _of_its_times(NoticeKind.CLOSES, race, event, now)


def _of_its_times(kind: NoticeKind, race: Race, event: Event, now: datetime) -> int:
    params = {"race": race.name, "closes": moment(race.closes_at)}
    return tell(Told(kind, event.once or "", concerned(race, now), race.get_absolute_url(), params), now)


def _cancelled(event: Event, now: datetime) -> int:
    """Who was in a race that was called off reads why."""
    race = Race.objects.filter(pk=event.race).first()
    if race is None or event.at <= now - REACH:
        return 0
    params = {"race": race.name, "text": event.data["reason"]}
    return tell(Told(NoticeKind.CANCELLED, race.slug, entered(race), race.get_absolute_url(), params), now)


def _counted(event: Event, now: datetime) -> int:
    """A result counts: its racer reads it, and who has lost the lead by it reads that."""
    of_race = ("evaluation__result", "entry__race", "entry__racer")
    submission = Submission.objects.filter(pk=event.data["submission"]).select_related(*of_race).first()
    told = 0
    if submission is not None:  # by now perhaps another run of the car, which was driven again
        told += _result(submission.evaluation, submission, now)
        counts = submission.entry.best_id == submission.pk and _is_recent(event, now)
        if counts and can_see_evaluation(None, submission.evaluation):
            told += tell_of_lead(submission.entry, event, now)
    return told + _lead(event, now)


def _timed(event: Event, now: datetime) -> int:
    """A session with a real car has ended: its racer reads what it was worth, and who has lost the lead by it that."""
    sessions = TimedSession.objects.filter(pk=event.data["session"], discarded_at=None, ended_at__gt=now - REACH)
    session, told = sessions.select_related("race", "entry__race", "entry__racer").prefetch_related("laps").first(), 0
    if session is not None:
        laps = counted_laps(session.race, sorted(session.laps.all(), key=lambda lap: lap.number))
        standing, place = standing_in(session.race, laps), place_of(session.entry)
        params: dict[str, Any] = {
            "race": session.race.name,
            "score_ms": standing.score_ms,
            "streak": longest_streak(laps),
            "needed": laps_needed(session.race),
            "rank": place.rank,
            "of": place.totals.racers,
        }
        page = session.race.get_absolute_url()
        told += tell(Told(NoticeKind.RESULT, str(session.pk), [session.entry.racer_id], page, params), now)
        if session.entry.best_session_id == session.pk:
            told += tell_of_lead(session.entry, event, now)
    return told + _lead(event, now)


def _failed(event: Event, now: datetime) -> int:
    # what was driven again is no news
    failed = Evaluation.objects.filter(public_id=event.subject, state=State.FAILED, redrive=None)
    submission = Submission.objects.filter(evaluation__in=failed).select_related("evaluation", "entry__race").first()
    return 0 if submission is None else _result(submission.evaluation, submission, now)


def _result(run: Evaluation, submission: Submission, now: datetime) -> int:
    before = Redrive.objects.filter(evaluation=run).select_related("replaced").first()
    driven = [run, *([before.replaced] if before is not None and before.replaced is not None else [])]
    if any(one.ended_at is None or one.ended_at <= now - REACH for one in driven):
        return 0
    params = _result_told(run, submission)
    return tell(Told(NoticeKind.RESULT, run.public_id, [run.owner_id], run.get_absolute_url(), params), now)


def _result_told(run: Evaluation, submission: Submission) -> dict[str, Any]:
    """What the notice of a run says: its score and the place by it as they are now, or why it has none."""
    told: dict[str, Any] = {"race": submission.entry.race.name}
    if run.state == State.FAILED:
        return told | {"reason": run.reason_code, "reason_params": run.reason_params}
    found = result_of(submission, run.result.laps, tell_earlier=True)
    if found is None or found.change is None:
        return told
    return told | {
        "score_ms": found.standing.score_ms,
        "streak": found.streak,
        "needed": laps_needed(found.race),
        "rank": None if found.place.is_drawn else found.place.rank,
        "of": found.place.totals.racers,
        "change": found.change.kind.value,
        "by": found.change.by,
    }


def _retimed(event: Event, now: datetime) -> int:
    """Whose time another engine has changed, with both times and places. Whoever leads since is not told of as if they
    had driven past the others."""
    race = Race.objects.filter(pk=event.race).first()
    if race is None or event.at <= now - REACH:
        return 0
    for leader in podiums([race], size=1)[race.pk]:
        Lead.objects.filter(race=race).update(racer=leader.racer)
    told = 0
    about = f"{race.slug}:{event.at:%Y%m%d%H%M%S}"
    for row in Retiming.objects.filter(entry__race=race, at=event.at).select_related("entry").order_by("pk"):
        if row.entry.is_withdrawn:
            continue
        params: dict[str, Any] = {"race": race.name, "engine": row.new_engine, "before": row.old_engine}
        params |= {name: getattr(row, name) for name in _RETIMED}
        if row.reason_code:
            params |= {"reason": row.reason_code, "reason_params": row.reason_params}
        told += tell(Told(NoticeKind.RETIMED, about, [row.entry.racer_id], race.get_absolute_url(), params), now)
    return told


def _lead(event: Event, now: datetime) -> int:
    """Whoever was seen in the lead of a race that is open or has just closed, and is not any more."""
    race = _race(event)
    if race is None or not race.opens_at <= now < race.closes_at + A_DAY or _is_retimed_later(event):
        return 0
    leader = next(iter(podiums([race], size=1)[race.pk]), None)
    seen = Lead.objects.filter(race=race).values_list("racer", flat=True).first()
    if leader is None or leader.racer.pk == seen:
        return 0
    Lead.objects.update_or_create(race=race, defaults={"racer": leader.racer})
    if seen is None or not Entry.objects.filter(race=race, racer=seen, withdrawn_at=None).exists():
        return 0
    about, params = f"{race.slug}:{leader.entry.best_id or leader.entry.pk}", {"race": race.name}
    params["leader"] = leader.alias
    return tell(Told(NoticeKind.LOST_LEAD, about, [seen], race.get_absolute_url(), params), now)


def _is_retimed_later(event: Event) -> bool:
    """Whether the board as it is now is another engine's, which is told when its turn comes."""
    later = Event.objects.filter(race=event.race, position__gt=event.position, kind=of_races.RACE_RETIMED.name)
    return later.exists()


def _official(event: Event, now: datetime) -> int:
    """A round has become official, or a community race that closed has timed its last car."""
    race = _race(event)
    if race is None:
        return 0
    round_ = Round.objects.filter(race=race).first()
    since, reach = (race.closes_at, REACH) if race.kind == RaceKind.COMMUNITY else (event.at, OUTCOME_REACH)
    if since <= now - reach or (round_ is not None and round_.closed_at != event.at):
        return 0
    params = {"race": race.name}
    told = tell(Told(NoticeKind.OFFICIAL, event.once or "", entered(race), race.get_absolute_url(), params), now)
    return told + tell_of_win(race, event, now)


def _moved_on(event: Event, now: datetime) -> int:
    """A promotion, a place in a finale or a qualification, as far as it still holds."""
    rounds = Round.objects.filter(pk=event.data["round"], closed_at__gt=now - OUTCOME_REACH, race__imported_at=None)
    round_ = rounds.select_related("season", "race").first()
    if round_ is None or not holds(event):
        return 0
    season, page = round_.season, round_.season.get_absolute_url()
    params = {"season": season.name}
    if event.kind == PROMOTED.name:
        what = Told(NoticeKind.PROMOTED, season.slug, [_concerned(event)], page, params)
    elif event.kind == IN_FINALE.name:
        params = {"month": round_.name or round_.race.name} | params
        what = Told(NoticeKind.FINALE, round_.race.slug, [_concerned(event)], f"{page}finales/", params)
    else:
        what = Told(NoticeKind.QUALIFIED, season.slug, [_concerned(event)], f"{page}finales/", params)
    return tell(what, now)


def _decided(event: Event, now: datetime) -> int:
    """Stewards have disqualified somebody or put them back, and why."""
    decisions = StewardDecision.objects.filter(pk=event.subject, round__race__imported_at=None)
    one = decisions.select_related("round__race", "round__season").first()
    if one is None or event.at <= now - OUTCOME_REACH:
        return 0
    round_, params = one.round, {"race": one.round.race.name, "text": one.reason}
    kind = NoticeKind.DISQUALIFIED if event.kind == DISQUALIFIED.name else NoticeKind.RESTORED
    settled = round_.settled_at
    if kind == NoticeKind.DISQUALIFIED and (settled is None or round_.is_under_review(now)):
        params["until"] = "" if settled is None else moment(settled)
    return tell(Told(kind, event.subject, [_concerned(event)], round_.race.get_absolute_url(), params), now)


def _cup(event: Event, now: datetime) -> int:
    """Everybody with a place in a cup reads which."""
    if event.at <= now - REACH:
        return 0
    told = 0
    for one in CupPlace.objects.filter(cup__day=event.subject).select_related("cup").order_by("pk"):
        params = {"day": event.subject, "place": one.place, "division": one.division}
        told += tell(Told(NoticeKind.CUP, event.subject, [one.racer_id], one.cup.get_absolute_url(), params), now)
    return told + tell_of_cup(event, now)


def _asked(event: Event, now: datetime) -> int:
    """A racer is asked to join a team, unless they have answered by now; by one team at most once a day."""
    invitations = TeamInvitation.objects.filter(team__slug=event.subject, racer=_concerned(event))
    asked = invitations.select_related("team").first()
    if asked is None or not _is_recent(event, now):
        return 0
    about, params = f"{event.subject}:{event.at:%Y%m%d}", {"team": asked.team.name}
    return tell(Told(NoticeKind.TEAM, about, [asked.racer_id], asked.team.get_absolute_url(), params), now)


def _drafted(event: Event, now: datetime) -> int:
    """Admins who may change seasons read that the next one is drafted, if it still stands and has not begun."""
    season = Season.objects.filter(slug=event.subject).first()
    opens = datetime.fromisoformat(event.data["opens"])
    if season is None or (not _is_recent(event, now) and opens <= now):
        return 0
    params = {"season": season.name, "before": event.data["before"], "opens": moment(opens)}
    if event.data["left_out"]:
        params["left_out"] = event.data["left_out"]
    readers = admins_with("league.change_season")
    return tell(Told(NoticeKind.SEASON, str(season.pk), readers, season.get_absolute_url(), params), now)


def _is_recent(event: Event, now: datetime) -> bool:
    return event.at > now - REACH


def _concerned(event: Event) -> int:
    assert event.racer_id is not None, "events of its kind name a racer"
    return event.racer_id


def _race(event: Event) -> Race | None:
    """The race of an event, unless it was called off, recorded elsewhere or is gone."""
    return Race.objects.filter(pk=event.race, cancelled_at=None, imported_at=None).first()


_TELLING: dict[EventKind, Callable[[Event, datetime], int]] = {
    of_races.RACE_OPENED: _opened,
    of_races.RACE_CLOSING: _closing,
    of_races.RACE_CANCELLED: _cancelled,
    of_races.RACE_RESULT: _counted,
    of_races.RACE_TIMED: _timed,
    of_races.RACE_RETIMED: _retimed,
    of_races.RACE_BOARD: _lead,
    of_races.DUELS_DRAWN: _lead,
    of_races.DUEL_DECIDED: _lead,
    of_races.RACE_OFFICIAL: _official,
    RUN_FAILED: _failed,
    PROMOTED: _moved_on,
    IN_FINALE: _moved_on,
    QUALIFIED: _moved_on,
    CUP_OVER: _cup,
    TEAM_INVITED: _asked,
    DISQUALIFIED: _decided,
    RESTORED: _decided,
    SEASON_DRAFTED: _drafted,
}
_BY_NAME = {kind.name: telling for kind, telling in _TELLING.items()}

# Writes notices; told is how many.
NOTICES = EventReader("notices", tuple(_TELLING), lambda event, now: _BY_NAME[event.kind](event, now))
