"""The reader of events that writes racers' notices, which show the present state, not that of the event."""

from collections.abc import Callable
from datetime import datetime, timedelta

from django.db.models import Q
from django.urls import reverse

from accounts.events import TEAM_INVITED
from accounts.following import followers_of
from accounts.models import TeamInvitation
from core.events import Event, EventKind, EventReader
from evaluation.models import Evaluation, State
from evaluation.running.events import RUN_FAILED
from races import events as of_races
from races.boards.counted_laps import counted_laps
from races.boards.ranking import laps_needed, longest_streak, standing_in
from races.boards.selectors.board import podiums
from races.boards.selectors.counts import totals_of
from races.boards.selectors.results import place_of, result_of
from races.entries.selectors.visibility import can_see_evaluation
from races.entries.time_checks import moment
from races.models import Entry, Race, RaceKind, Recheck, Redrive, Retiming, Submission, TimedSession, Visibility

from ..events import CUP_OVER, DISQUALIFIED, IN_FINALE, PROMOTED, QUALIFIED, RESTORED, SEASON_DRAFTED
from ..models import Cup, CupPlace, Lead, Round, Season, StewardDecision
from ..racers.selectors import LEAST
from ..standings.selectors.outcomes import holds
from . import kinds
from .kinds import NoticeKind
from .writer import NewNotice, Params, admins_with, concerned_racers, entered_racers, notify

REACH = timedelta(days=3)
OUTCOME_REACH = timedelta(days=30)
A_DAY = timedelta(days=1)
_RETIMED = ("old_score_ms", "old_rank", "new_score_ms", "new_rank")


def _opened(event: Event, now: datetime) -> int:
    race = _race(event)
    if race is None or event.at <= now - REACH or not race.opens_at <= now < race.closes_at:
        return 0
    return _of_its_times(kinds.OPENS, race, event, now)


def _closing(event: Event, now: datetime) -> int:
    race = _race(event)
    if race is None or not now < race.closes_at <= now + A_DAY:
        return 0
    return _of_its_times(kinds.CLOSES, race, event, now)


def _of_its_times(kind: NoticeKind, race: Race, event: Event, now: datetime) -> int:
    params = {"race": race.name, "closes": moment(race.closes_at)}
    return notify(NewNotice(kind, event.once or "", concerned_racers(race, now), race.get_absolute_url(), params), now)


def _cancelled(event: Event, now: datetime) -> int:
    race = Race.objects.filter(pk=event.race).first()
    if race is None or event.at <= now - REACH:
        return 0
    params = {"race": race.name, "text": event.data["reason"]}
    return notify(NewNotice(kinds.CANCELLED, race.slug, entered_racers(race), race.get_absolute_url(), params), now)


def _counted(event: Event, now: datetime) -> int:
    """A result counts: notices to its racer, to their followers and to the racer who lost the lead by it."""
    of_race = ("evaluation__result", "entry__race", "entry__racer")
    submission = Submission.objects.filter(pk=event.data["submission"]).select_related(*of_race).first()
    written = 0
    if submission is not None:  # by now perhaps another run of the car, which was driven again
        written += _result(submission.evaluation, submission, now)
        counts = submission.entry.best_id == submission.pk and _is_recent(event, now)
        if counts and can_see_evaluation(None, submission.evaluation):
            written += notify_followers_of_lead(submission.entry, event, now)
    return written + _lead(event, now)


def _timed(event: Event, now: datetime) -> int:
    """A session with a real car has ended: notices to its racer, their followers and the racer who lost the lead."""
    sessions = TimedSession.objects.filter(pk=event.data["session"], discarded_at=None, ended_at__gt=now - REACH)
    session = sessions.select_related("race", "entry__race", "entry__racer").prefetch_related("laps").first()
    written = 0
    if session is not None:
        laps = counted_laps(session.race, sorted(session.laps.all(), key=lambda lap: lap.number))
        standing, place = standing_in(session.race, laps), place_of(session.entry)
        params = {
            "race": session.race.name,
            "score_ms": standing.score_ms,
            "streak": longest_streak(laps),
            "needed": laps_needed(session.race),
            "rank": place.rank,
            "of": place.totals.racers,
        }
        page = session.race.get_absolute_url()
        written += notify(NewNotice(kinds.RESULT, str(session.pk), [session.entry.racer_id], page, params), now)
        if session.entry.best_session_id == session.pk:
            written += notify_followers_of_lead(session.entry, event, now)
    return written + _lead(event, now)


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
    params = _result_params(run, submission)
    return notify(NewNotice(kinds.RESULT, run.public_id, [run.owner_id], run.get_absolute_url(), params), now)


def _result_params(run: Evaluation, submission: Submission) -> Params:
    params = {"race": submission.entry.race.name}
    if run.state == State.FAILED:
        return {**params, "reason": run.reason_code, "reason_params": run.reason_params}
    found = result_of(submission, run.result.laps, with_earlier=True)
    if found is None or found.change is None:
        return params
    return {
        **params,
        "score_ms": found.standing.score_ms,
        "streak": found.streak,
        "needed": laps_needed(found.race),
        "rank": None if found.place.is_drawn else found.place.rank,
        "of": found.place.totals.racers,
        "change": found.change.kind.value,
        "by": found.change.by,
    }


def _retimed(event: Event, now: datetime) -> int:
    """Another engine changed times: notices with both times and places. A new leader is not a lost lead."""
    race = Race.objects.filter(pk=event.race).first()
    if race is None or event.at <= now - REACH:
        return 0
    for leader in podiums([race], size=1)[race.pk]:
        Lead.objects.filter(race=race).update(racer=leader.racer)
    written = 0
    about = f"{race.slug}:{event.at:%Y%m%d%H%M%S}"
    for row in Retiming.objects.filter(entry__race=race, at=event.at).select_related("entry").order_by("pk"):
        if row.entry.is_withdrawn:
            continue
        fault = {"reason": row.reason_code, "reason_params": row.reason_params} if row.reason_code else {}
        scores = {name: getattr(row, name) for name in _RETIMED}
        params = {"race": race.name, "engine": row.new_engine, "before": row.old_engine, **scores, **fault}
        written += notify(NewNotice(kinds.RETIMED, about, [row.entry.racer_id], race.get_absolute_url(), params), now)
    return written


def _lead(event: Event, now: datetime) -> int:
    """The leader of a race that is open or has just closed changed: a notice to the previous one."""
    race = _race(event)
    later = Event.objects.filter(race=event.race, position__gt=event.position, kind=of_races.RACE_RETIMED.name)
    if race is None or not race.opens_at <= now < race.closes_at + A_DAY or later.exists():
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
    return notify(NewNotice(kinds.LOST_LEAD, about, [seen], race.get_absolute_url(), params), now)


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
    written = notify(
        NewNotice(kinds.OFFICIAL, event.once or "", entered_racers(race), race.get_absolute_url(), params), now
    )
    return written + notify_followers_of_win(race, event, now)


def _moved_on(event: Event, now: datetime) -> int:
    """A promotion, a place in a finale or a qualification, as far as it still holds."""
    rounds = Round.objects.filter(pk=event.data["round"], closed_at__gt=now - OUTCOME_REACH, race__imported_at=None)
    round_ = rounds.select_related("season", "race").first()
    if round_ is None or not holds(event):
        return 0
    season, page = round_.season, round_.season.get_absolute_url()
    kind, about, path, params = kinds.QUALIFIED, season.slug, f"{page}finales/", {"season": season.name}
    if event.kind == PROMOTED.name:
        kind, path = kinds.PROMOTED, page
    elif event.kind == IN_FINALE.name:
        kind, about = kinds.FINALE, round_.race.slug
        params["month"] = round_.name or round_.race.name
    return notify(NewNotice(kind, about, [_concerned(event)], path, params), now)


def _decided(event: Event, now: datetime) -> int:
    decisions = StewardDecision.objects.filter(pk=event.subject, round__race__imported_at=None)
    one = decisions.select_related("round__race", "round__season").first()
    if one is None or event.at <= now - OUTCOME_REACH:
        return 0
    round_, params = one.round, {"race": one.round.race.name, "text": one.reason}
    kind = kinds.DISQUALIFIED if event.kind == DISQUALIFIED.name else kinds.RESTORED
    settled = round_.settled_at
    if kind == kinds.DISQUALIFIED and (settled is None or round_.is_under_review(now)):
        params["until"] = "" if settled is None else moment(settled)
    return notify(NewNotice(kind, event.subject, [_concerned(event)], round_.race.get_absolute_url(), params), now)


def _cup(event: Event, now: datetime) -> int:
    if event.at <= now - REACH:
        return 0
    written = 0
    for one in CupPlace.objects.filter(cup__day=event.subject).select_related("cup").order_by("pk"):
        params: Params = {"day": event.subject, "place": one.place, "division": one.division}
        written += notify(NewNotice(kinds.CUP, event.subject, [one.racer_id], one.cup.get_absolute_url(), params), now)
    return written + notify_followers_of_cup(event, now)


def _team_invited(event: Event, now: datetime) -> int:
    """A team invited a racer: a notice while the invitation is open, at most one a day from each team."""
    invitations = TeamInvitation.objects.filter(team__slug=event.subject, racer=_concerned(event))
    asked = invitations.select_related("team").first()
    if asked is None or not _is_recent(event, now):
        return 0
    about, params = f"{event.subject}:{event.at:%Y%m%d}", {"team": asked.team.name}
    return notify(NewNotice(kinds.TEAM, about, [asked.racer_id], asked.team.get_absolute_url(), params), now)


def _drafted(event: Event, now: datetime) -> int:
    """A season was drafted: notices to admins, unless it was deleted or has begun."""
    season = Season.objects.filter(slug=event.subject).first()
    opens = datetime.fromisoformat(event.data["opens"])
    if season is None or (not _is_recent(event, now) and opens <= now):
        return 0
    params = {"season": season.name, "before": event.data["before"], "opens": moment(opens)}
    if event.data["left_out"]:
        params["left_out"] = event.data["left_out"]
    readers = admins_with("league.change_season")
    return notify(NewNotice(kinds.SEASON, str(season.pk), readers, season.get_absolute_url(), params), now)


def _differs(event: Event, now: datetime) -> int:
    """An official result differs from its recheck: notices to admins."""
    recheck = Recheck.objects.filter(pk=event.data["recheck"]).select_related("evaluation").first()
    if recheck is None:
        return 0
    params = {
        "run": recheck.evaluation.public_id,
        "worker": recheck.worker,
        "what": ", ".join(recheck.differences),
    }
    path = reverse("admin:races_recheck_change", args=[recheck.pk])
    return notify(NewNotice(kinds.DIFFERS, str(recheck.pk), admins_with("races.change_recheck"), path, params), now)


def _is_recent(event: Event, now: datetime) -> bool:
    return event.at > now - REACH


def _concerned(event: Event) -> int:
    assert event.racer_id is not None, "events of its kind name a racer"
    return event.racer_id


def _race(event: Event) -> Race | None:
    """The race of an event, unless it was called off, recorded elsewhere or is gone."""
    return Race.objects.filter(pk=event.race, cancelled_at=None, imported_at=None).first()


_WRITERS: dict[EventKind, Callable[[Event, datetime], int]] = {
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
    TEAM_INVITED: _team_invited,
    DISQUALIFIED: _decided,
    RESTORED: _decided,
    SEASON_DRAFTED: _drafted,
    of_races.RESULT_DIFFERS: _differs,
}
_BY_NAME = {kind.name: write for kind, write in _WRITERS.items()}

# Each writer returns the number of notices it wrote.
NOTICES = EventReader("notices", tuple(_WRITERS), lambda event, now: _BY_NAME[event.kind](event, now))


def notify_followers_of_lead(entry: Entry, event: Event, now: datetime) -> int:
    """Notify the followers of a racer whose new best put them first, while they lead. Uses ``entry.race``."""
    race = entry.race
    if not _is_everybodys(race) or entry.is_withdrawn or entry.is_baseline:
        return 0
    followers = followers_of(entry.racer_id)
    if not followers:
        return 0
    place = place_of(entry)
    if place.rank != 1 or place.totals.classified < LEAST:
        return 0
    params = {"racer": entry.racer.alias, "race": race.name, "what": "lead", "score_ms": entry.score_ms}
    return notify(_follower_notice(entry.racer_id, race, event, followers, params), now)


def notify_followers_of_win(race: Race, event: Event, now: datetime) -> int:
    """Notify the followers of the winner of a race. Races of a cup are left to :func:`notify_followers_of_cup`."""
    if not _is_everybodys(race) or totals_of(race).classified < LEAST:
        return 0
    first = next(iter(podiums([race], size=1)[race.pk]), None)
    followers = [] if first is None else followers_of(first.racer.pk)
    if first is None or not followers or Cup.objects.filter(Q(race=race) | Q(divisions__race=race)).exists():
        return 0
    params = {"racer": first.alias, "race": race.name, "what": "race"}
    return notify(_follower_notice(first.racer.pk, race, event, followers, params), now)


def notify_followers_of_cup(event: Event, now: datetime) -> int:
    written = 0
    won = CupPlace.objects.filter(cup__day=event.subject, place=1).select_related("cup__race", "racer").order_by("pk")
    for one in won:
        if _is_everybodys(one.cup.race) and (followers := followers_of(one.racer_id)):
            params: Params = {"racer": one.racer.alias, "what": "cup", "division": one.division, "day": event.subject}
            about = f"{one.racer_id}:cup:{event.subject}"
            written += notify(NewNotice(kinds.FOLLOWED, about, followers, one.cup.get_absolute_url(), params), now)
    return written


def _is_everybodys(race: Race) -> bool:
    return race.visibility == Visibility.PUBLIC and race.cancelled_at is None and race.imported_at is None


def _follower_notice(racer: int, race: Race, event: Event, followers: list[int], params: Params) -> NewNotice:
    about = f"{racer}:{race.slug}:{event.at:%Y%m%d}"
    return NewNotice(kinds.FOLLOWED, about, followers, race.get_absolute_url(), params)
