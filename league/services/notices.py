"""Telling racers what concerns them: worked out from what is in the database at a moment, so that a scheduler that
stood still delays notices and nothing else, and each is sent once whoever is asked how often.

What happened longer than ``REACH`` ago is not told any more; what came of a round for a racer, longer than
``OUTCOME_REACH`` ago.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from functools import partial
from itertools import groupby
from typing import Any

from allauth.account.models import EmailAddress
from django.conf import settings
from django.core import signing
from django.core.mail import get_connection
from django.core.mail.message import EmailMessage
from django.db import IntegrityError, transaction
from django.db.models import CharField, Exists, F, OuterRef, Q, QuerySet
from django.db.models.functions import Cast
from django.urls import reverse
from django.utils import translation
from django.utils.translation import gettext as _

from accounts.models import Racer
from evaluation.models import Evaluation, State
from races.models import Division, Entry, Kind, Race, Redrive, Retiming
from races.selectors import podiums
from races.selectors.results import result_of
from races.services.gates import moment

from ..models import (
    Announcement,
    ChampionshipPlace,
    Decision,
    FinalePlace,
    Lead,
    Membership,
    Notice,
    NoticeChoice,
    NoticeKind,
    Round,
    Stage,
    StewardDecision,
)
from ..models.notice import NOT_MAILED
from ..models.season import WITH_FIELD
from ..notices import sentence
from .closing import cars_on_the_way

logger = logging.getLogger(__name__)
REACH = timedelta(days=3)
OUTCOME_REACH = timedelta(days=30)
A_DAY = timedelta(days=1)
SEEN_LATELY = timedelta(days=60)  # who has not logged in for longer is not reminded of open races
KEPT = timedelta(days=180)
MAILS_A_TIME = 200
MAIL_TRIES = 3
BATCH = 500
_STOPPING = "league.notices.stop"
_RETIMED = ("old_score_ms", "old_rank", "new_score_ms", "new_rank")
_DECIDED = {Decision.DISQUALIFIED: NoticeKind.DISQUALIFIED, Decision.RESTORED: NoticeKind.RESTORED}


@dataclass(frozen=True)
class _Told:
    """Something to tell racers (ids)."""

    kind: NoticeKind
    about: str
    racers: Iterable[int]
    path: str
    params: Mapping[str, Any] = field(default_factory=dict)


def tell_what_happened(*, now: datetime) -> int:
    """Write every notice that is due at ``now``; returns how many are new."""
    steps = (_openings, _closings, _cancellations, _results, _retimings, _leads, _outcomes, _officials, _decisions)
    told = sum(step(now) for step in steps)
    Notice.objects.filter(at__lt=now - KEPT).delete()
    return told


def announce(*, race: Race, text: str, now: datetime) -> int:
    """Tell everybody whom a race concerns a few words of its organisers; returns how many. Empty words tell nobody."""
    text = " ".join(text.split())[:500]
    if not text:
        return 0
    params = {"race": race.name, "text": text}
    about = f"{race.slug}:{now:%Y%m%d%H%M%S%f}"
    concerned = sorted(_concerned(race, now))
    return _tell(_Told(NoticeKind.MESSAGE, about, concerned, race.get_absolute_url(), params), now)


def mark_read(*, racer: Racer, now: datetime, notice: int | None = None) -> int:
    """Mark one of the racer's notices as read, or all of them; returns how many were unread."""
    unread = Notice.objects.filter(racer=racer, read_at=None, hidden=False)
    if notice is not None:
        unread = unread.filter(pk=notice)
    return unread.update(read_at=now)


@transaction.atomic
def choose_notices(*, racer: Racer, site_off: Iterable[str], mail_off: Iterable[str], language: str) -> NoticeChoice:
    """Say which kinds the racer does not want in the site or by mail, and the language of mails. Raises ValueError."""
    site, mail = (sorted(set(kinds)) for kinds in (site_off, mail_off))
    if not set(site + mail) <= set(NoticeKind.values) or language not in dict(settings.LANGUAGES):
        raise ValueError("no such kind of notice, or no such language")
    values = {"site_off": site, "mail_off": mail, "language": language}
    return NoticeChoice.objects.update_or_create(racer=racer, defaults=values)[0]


def choice_of(racer: Racer) -> NoticeChoice:
    """What the racer has chosen, or what is usual; not saved then."""
    chosen = NoticeChoice.objects.filter(racer=racer).first()
    return chosen or NoticeChoice(racer=racer, mail_off=list(NOT_MAILED), language=translation.get_language() or "en")


def stopping_token(racer_id: int, kind: str) -> str:
    """What a mail carries so that its reader can turn mails of its kind off without logging in."""
    return signing.dumps([racer_id, kind], salt=_STOPPING)


def what_stops(token: str) -> tuple[Racer, NoticeKind] | None:
    """Whose mails of which kind a token turns off; None for a token that this site did not write."""
    try:
        racer_id, kind = signing.loads(token, salt=_STOPPING)
    except (signing.BadSignature, ValueError, TypeError):
        return None
    racer = Racer.objects.filter(pk=racer_id, is_active=True).first()
    return None if racer is None or kind not in NoticeKind.values else (racer, NoticeKind(kind))


@transaction.atomic
def stop_mails(*, racer: Racer, kind: NoticeKind) -> None:
    """Turn mails of one kind off; everything else stays as the racer has it. Doing it again changes nothing."""
    chosen = choice_of(racer)
    chosen.mail_off = sorted({*chosen.mail_off, kind.value})
    chosen.save()
    Notice.objects.filter(racer=racer, kind=kind, mail_state="due").update(mail_state="")


def send_mails(*, now: datetime) -> int:
    """Send what is to go by mail: each at most once, three tries if the mail server refuses. Returns how many went."""
    due = Notice.objects.filter(mail_state="due").order_by("at", "pk").values_list("pk", flat=True)
    sent = 0
    with get_connection() as server:
        for pk in list(due[:MAILS_A_TIME]):
            # claimed before it is sent: a second sender finds nothing, and a crash loses a mail rather than doubles it
            if Notice.objects.filter(pk=pk, mail_state="due").update(mail_state="sent", mail_tries=F("mail_tries") + 1):
                sent += _mail(Notice.objects.select_related("racer").get(pk=pk), server)
    return sent


def _mail(notice: Notice, server: Any) -> bool:
    address = _verified([notice.racer_id]).get(notice.racer_id)
    if address is None:
        return False
    token = stopping_token(notice.racer_id, notice.kind)
    stop = f"{settings.SITE_URL}{reverse('notices_stop', args=[token])}"
    with translation.override(choice_of(notice.racer).language):
        text = sentence(notice)
        body = "\n\n".join(
            [
                _("Hello %(racer)s,") % {"racer": notice.racer.alias},
                text,
                f"{settings.SITE_URL}{notice.path}",
                _("Which notices you get is up to you: %(address)s")
                % {"address": f"{settings.SITE_URL}/settings/notices/"},
                _("No more e-mails of this kind: %(address)s") % {"address": stop},
            ]
        )
    try:
        # RFC 2369 and 8058: mail programs show a button that posts to this address
        headers = {"List-Unsubscribe": f"<{stop}>", "List-Unsubscribe-Post": "List-Unsubscribe=One-Click"}
        EmailMessage(f"[Paddock] {text}", body + "\n", to=[address], connection=server, headers=headers).send()
    except Exception as error:  # whatever the mail backend raises: it is tried again, then given up
        state = "due" if notice.mail_tries < MAIL_TRIES else "failed"
        Notice.objects.filter(pk=notice.pk).update(mail_state=state)
        trace = None if isinstance(error, OSError) else error  # a mail server that is away or refuses says enough
        logger.warning("A mail to a racer could not be sent (try %s): %s", notice.mail_tries, error, exc_info=trace)
        return False
    return True


def _tell(told: _Told, now: datetime) -> int:
    """Write notices to all who can read them and want them; those who were told already are left out."""
    ids = list(told.racers)
    written = 0
    for start in range(0, len(ids), BATCH):
        readers = Racer.objects.filter(pk__in=ids[start : start + BATCH], is_active=True, is_house=False)
        known = Notice.objects.filter(kind=told.kind, about=told.about, racer=OuterRef("pk"))
        new = list(readers.exclude(Exists(known)).values_list("pk", flat=True))
        choices = NoticeChoice.objects.in_bulk(new)
        verified = _verified(new)
        rows = []
        for racer in new:
            chosen = choices.get(racer) or NoticeChoice(mail_off=list(NOT_MAILED))
            mailed = racer in verified and told.kind not in chosen.mail_off
            hidden = told.kind in chosen.site_off
            # also who wants none has a row, so that the next look finds nothing to tell
            rows.append(
                Notice(
                    racer_id=racer,
                    kind=told.kind,
                    about=told.about,
                    path=told.path,
                    params=dict(told.params),
                    at=now,
                    hidden=hidden,
                    mail_state="due" if mailed else "",
                )
            )
        Notice.objects.bulk_create(rows, ignore_conflicts=True)
        written += len(rows)
    return written


def _verified(racers: Iterable[int]) -> dict[int, str]:
    """The confirmed address of each racer who has one: nobody else's mailbox is written to."""
    found = EmailAddress.objects.filter(user__in=list(racers), verified=True).order_by("primary", "pk")
    return dict(found.values_list("user_id", "email"))


def _announce(about: str, now: datetime, tell: Callable[[], int]) -> int:
    """Tell everybody at once, in one transaction, unless it was told."""
    if Announcement.objects.filter(about=about).exists():
        return 0
    try:
        with transaction.atomic():
            Announcement.objects.create(about=about, at=now)
            return tell()
    except IntegrityError:  # another one was quicker
        return 0


def _concerned(race: Race, now: datetime) -> set[int]:
    """Who is in a race, and for a league race who may be and looks in now and then."""
    entered = Entry.objects.filter(race=race, withdrawn_at=None, is_baseline=False)
    racers = set(entered.values_list("racer", flat=True))
    round_ = Round.objects.filter(race=race).first()
    if round_ is None or race.kind != Kind.LEAGUE or round_.stage in WITH_FIELD:
        return racers
    pros = Membership.objects.filter(season=round_.season_id, division=Division.PRO).values("racer")
    seen = Racer.objects.filter(Q(last_login__gt=now - SEEN_LATELY), is_active=True)
    if race.division == Division.PRO:
        seen = seen.filter(pk__in=pros)
    elif race.division == Division.OPEN:
        seen = seen.exclude(pk__in=pros)
    return racers | set(seen.values_list("pk", flat=True))


def _races(**conditions: Any) -> QuerySet[Race]:
    return Race.objects.filter(cancelled_at=None, imported_at=None, **conditions).order_by("closes_at", "pk")


def _openings(now: datetime) -> int:
    opened = _races(opens_at__lte=now, opens_at__gt=now - REACH, closes_at__gt=now)
    return sum(
        _announce(f"opens:{race.slug}:{race.opens_at:%Y%m%d%H%M}", now, _about(race, NoticeKind.OPENS, now))
        for race in opened
    )


def _closings(now: datetime) -> int:
    # a race that lasts no longer than a day has only just told that it opens
    closing = _races(opens_at__lte=now - A_DAY, closes_at__gt=now, closes_at__lte=now + A_DAY)
    return sum(
        _announce(f"closes:{race.slug}:{race.closes_at:%Y%m%d%H%M}", now, _about(race, NoticeKind.CLOSES, now))
        for race in closing
    )


def _cancellations(now: datetime) -> int:
    """Who was in a race that was called off reads why."""
    told = 0
    for race in Race.objects.filter(cancelled_at__gt=now - REACH, cancelled_at__lte=now).order_by("cancelled_at", "pk"):
        params = {"race": race.name, "text": race.cancel_reason}
        entered = Entry.objects.filter(race=race, withdrawn_at=None, is_baseline=False)
        racers = sorted(entered.values_list("racer", flat=True))
        what = _Told(NoticeKind.CANCELLED, race.slug, racers, race.get_absolute_url(), params)
        told += _announce(f"cancelled:{race.slug}", now, lambda what=what: _tell(what, now))
    return told


def _about(race: Race, kind: NoticeKind, now: datetime) -> Callable[[], int]:
    when = race.opens_at if kind == NoticeKind.OPENS else race.closes_at
    params = {"race": race.name, "closes": moment(race.closes_at)}

    def tell() -> int:
        about = f"{race.slug}:{when:%Y%m%d%H%M}"
        return _tell(_Told(kind, about, sorted(_concerned(race, now)), race.get_absolute_url(), params), now)

    return tell


def _results(now: datetime) -> int:
    ended = Evaluation.objects.filter(
        # what another engine than its race's drove is told once it counts
        Q(state=State.FAILED) | Q(result__engine=F("submission__entry__race__engine")),
        submission__isnull=False,
        ended_at__gt=now - REACH,
        ended_at__lte=now,
        state__in=[State.FINISHED, State.FAILED],
    )
    # what was driven again is no news to who was told of the car before
    before = Redrive.objects.filter(submission=OuterRef(OuterRef("submission")), replaced__isnull=False)
    told_of = Q(about=OuterRef("public_id")) | Q(about__in=before.values("replaced__public_id"))
    notice = Notice.objects.filter(told_of, kind=NoticeKind.RESULT, racer=OuterRef("owner"))
    recent = Q(redrive=None) | Q(redrive__replaced__ended_at__gt=now - REACH)
    ended = ended.filter(recent)
    new = ended.exclude(Exists(notice)).filter(owner__is_house=False, owner__is_active=True)
    told = 0
    for one in new.select_related("submission__entry__race", "result").order_by("ended_at", "pk"):
        params = _result_told(one)
        told += _tell(_Told(NoticeKind.RESULT, one.public_id, [one.owner_id], one.get_absolute_url(), params), now)
    return told


def _result_told(one: Evaluation) -> dict[str, Any]:
    """What the notice of a run says: its score and the place by it as they are now, or why it has none."""
    told: dict[str, Any] = {"race": one.submission.entry.race.name}
    if one.state == State.FAILED:
        return told | {"reason": one.reason_code, "reason_params": one.reason_params}
    found = result_of(one.submission, one.result.laps, tell_earlier=True)
    if found is None or found.change is None:
        return told
    return told | {
        "score_ms": found.standing.score_ms,
        "streak": found.streak,
        "needed": found.race.minimum_laps,
        "rank": None if found.place.is_drawn else found.place.rank,
        "of": found.place.totals.racers,
        "change": found.change.kind.value,
        "by": found.change.by,
    }


def _retimings(now: datetime) -> int:
    """Whose time another engine has changed, with both times and places. Whoever leads since is not told of as if they
    had driven past the others."""
    changed = Retiming.objects.filter(at__gt=now - REACH, at__lte=now).select_related("entry__race")
    told = 0
    by_race = groupby(changed.order_by("at", "entry__race", "pk"), lambda row: (row.at, row.entry.race))
    for (at, race), rows in by_race:
        tell = partial(_tell_retimed, at, race, list(rows), now)
        told += _announce(f"retimed:{race.slug}:{at:%Y%m%d%H%M%S}", now, tell)
    return told


def _tell_retimed(at: datetime, race: Race, rows: list[Retiming], now: datetime) -> int:
    for leader in podiums([race], size=1)[race.pk]:
        Lead.objects.filter(race=race).update(racer=leader.racer)
    told = 0
    for row in rows:
        if row.entry.is_withdrawn:
            continue
        params: dict[str, Any] = {"race": race.name, "engine": row.new_engine, "before": row.old_engine}
        params |= {name: getattr(row, name) for name in _RETIMED}
        if row.reason_code:
            params |= {"reason": row.reason_code, "reason_params": row.reason_params}
        about = f"{race.slug}:{at:%Y%m%d%H%M%S}"
        told += _tell(_Told(NoticeKind.RETIMED, about, [row.entry.racer_id], race.get_absolute_url(), params), now)
    return told


def _leads(now: datetime) -> int:
    """Whoever was seen in the lead of a race that is open or has just closed, and is not any more."""
    races = {race.pk: race for race in _races(opens_at__lte=now, closes_at__gt=now - A_DAY)}
    seen = dict(Lead.objects.filter(race__in=races).values_list("race", "racer"))
    told = 0
    for pk, rows in podiums(races.values(), size=1).items():
        leader = rows[0] if rows else None
        if leader is None or seen.get(pk) == leader.racer.pk:
            continue
        if pk not in seen:
            Lead.objects.get_or_create(race_id=pk, defaults={"racer": leader.racer})
            continue
        changed = Lead.objects.filter(race_id=pk, racer=seen[pk]).update(racer=leader.racer)
        if changed and Entry.objects.filter(race_id=pk, racer=seen[pk], withdrawn_at=None).exists():
            race, about = races[pk], f"{races[pk].slug}:{leader.entry.best_id or leader.entry.pk}"
            params = {"race": race.name, "leader": leader.alias}
            told += _tell(_Told(NoticeKind.LOST_LEAD, about, [seen[pk]], race.get_absolute_url(), params), now)
    return told


def _outcomes(now: datetime) -> int:
    """Promotions, finale fields and qualifications of rounds that have just become official."""
    rounds = Round.objects.filter(closed_at__gt=now - OUTCOME_REACH, closed_at__lte=now)
    rounds = rounds.filter(race__imported_at=None).select_related("season", "race")
    told = 0
    for one in rounds.order_by("closed_at", "pk"):
        season, page = one.season, one.season.get_absolute_url()
        if one.stage == Stage.OPEN:
            who = Membership.objects.filter(promoted_in=one).values_list("racer", flat=True)
            told += _tell(_Told(NoticeKind.PROMOTED, season.slug, who, page, {"season": season.name}), now)
        elif one.stage == Stage.PRO:
            who = FinalePlace.objects.filter(round=one).values_list("racer", flat=True)
            params = {"month": one.name or one.race.name, "season": season.name}
            told += _tell(_Told(NoticeKind.FINALE, one.race.slug, who, f"{page}finales/", params), now)
        elif one.stage == Stage.FINALE:
            who = ChampionshipPlace.objects.filter(round=one).values_list("racer", flat=True)
            told += _tell(
                _Told(NoticeKind.QUALIFIED, season.slug, who, f"{page}finales/", {"season": season.name}), now
            )
    return told


def _officials(now: datetime) -> int:
    """Rounds that have become official, and community races that closed and have timed their last car."""
    told = 0
    rounds = Round.objects.filter(closed_at__gt=now - OUTCOME_REACH, closed_at__lte=now, race__imported_at=None)
    for one in rounds.select_related("race").order_by("closed_at", "pk"):
        told += _official(one.race, f"{one.closed_at:%Y%m%d%H%M%S}", now)
    for race in _races(closes_at__gt=now - REACH, closes_at__lte=now, kind=Kind.COMMUNITY):
        if not Announcement.objects.filter(about=f"official:{race.slug}:").exists() and not cars_on_the_way(race):
            told += _official(race, "", now)
    return told


def _decisions(now: datetime) -> int:
    """Whom stewards have disqualified or put back, and why."""
    decided = StewardDecision.objects.filter(at__gt=now - OUTCOME_REACH, at__lte=now, decision__in=_DECIDED)
    decided = decided.filter(racer__is_house=False, racer__is_active=True, round__race__imported_at=None)
    same = Cast(OuterRef("pk"), CharField())
    notice = Notice.objects.filter(kind__in=_DECIDED.values(), about=same, racer=OuterRef("racer"))
    told = 0
    new = decided.exclude(Exists(notice)).select_related("round__race", "round__season")
    for one in new.order_by("at", "pk"):
        kind, round_ = _DECIDED[Decision(one.decision)], one.round
        params = {"race": round_.race.name, "text": one.reason}
        if kind == NoticeKind.DISQUALIFIED and (round_.closed_at is None or round_.is_under_review(now)):
            params["until"] = "" if round_.closed_at is None else moment(round_.settled_at)
        what = _Told(kind, str(one.pk), [one.racer_id], round_.race.get_absolute_url(), params)
        told += _tell(what, now)
    return told


def _official(race: Race, when: str, now: datetime) -> int:
    entered = Entry.objects.filter(race=race, withdrawn_at=None, is_baseline=False)

    def tell() -> int:
        racers = entered.order_by("pk").values_list("racer", flat=True)
        params = {"race": race.name}
        about = f"{race.slug}:{when}"
        return _tell(_Told(NoticeKind.OFFICIAL, about, racers, race.get_absolute_url(), params), now)

    return _announce(f"official:{race.slug}:{when}", now, tell)
