"""The sentences of notices, in the reader's language."""

from __future__ import annotations

from django.utils.translation import gettext as _
from django.utils.translation import gettext_noop

from core.jobs.models import reason_sentence
from core.times import clock, for_the_reader
from races.change import sentence as change_sentence
from races.names import named

from .models import Notice, NoticeKind

SENTENCES = {
    NoticeKind.OPENS: gettext_noop("%(race)s is open."),
    NoticeKind.CLOSES: gettext_noop("%(race)s closes in less than a day, at %(closes)s."),
    NoticeKind.RESULT: gettext_noop("The result of your car in %(race)s is in."),  # of an old one, which says no more
    NoticeKind.LOST_LEAD: gettext_noop("%(leader)s has taken the lead in %(race)s."),
    NoticeKind.PROMOTED: gettext_noop("You are promoted to the pro division of %(season)s."),
    NoticeKind.FINALE: gettext_noop("You are in the finale of %(month)s."),
    NoticeKind.QUALIFIED: gettext_noop("You have qualified for the championship of %(season)s."),
    NoticeKind.OFFICIAL: gettext_noop("The results of %(race)s are official."),
    NoticeKind.MESSAGE: gettext_noop("%(race)s: %(text)s"),
    NoticeKind.CANCELLED: gettext_noop("%(race)s is cancelled: %(text)s"),
    NoticeKind.DISQUALIFIED: gettext_noop("You are disqualified from %(race)s (%(text)s)."),
    NoticeKind.RESTORED: gettext_noop("You are no longer disqualified from %(race)s (%(text)s)."),
    NoticeKind.RETIMED: gettext_noop(
        "%(race)s was repeated with the engine %(engine)s. Your result: %(new)s (before, with %(before)s: %(old)s)."
    ),
    NoticeKind.CUP: gettext_noop("The cup of %(day)s is over. Your place in division %(division)s: %(place)s."),
    NoticeKind.FOLLOWED: gettext_noop("%(racer)s leads %(race)s with %(score)s."),
    NoticeKind.TEAM: gettext_noop("The team %(team)s asks you to join."),
    NoticeKind.SEASON: gettext_noop(
        "%(season)s is drafted. It continues %(before)s from %(opens)s. You can edit, replace or delete it before then."
    ),
}
# Added to the notice of a drafted season.
LEFT_OUT = gettext_noop("Races that could not be copied: %(left_out)s.")
# What else a racer who is followed has done, by ``params["what"]``.
FOLLOWED_WON = {
    "race": gettext_noop("%(racer)s has won %(race)s."),
    "cup": gettext_noop("%(racer)s has won division %(division)s of the cup of %(day)s."),
}
# What a racer can do about it. Told while it can be changed: "until" is empty before the results are official.
APPEAL = gettext_noop("If this is a mistake, contact the organisers. They can reinstate you.")
APPEAL_UNTIL = gettext_noop("If this is a mistake, contact the organisers. They can reinstate you until %(until)s.")


def sentence(notice: Notice) -> str:
    """What the notice says. Parameters that are missing from an old one stand as dashes."""
    names = {key: named(notice.params[key]) for key in _NAMES if isinstance(notice.params.get(key), str)}
    told = {key: for_the_reader(value) for key, value in notice.params.items()}
    params = _NoticeParams({**told, **names})
    if notice.kind == NoticeKind.RESULT and len(notice.params) > 1:
        return _result(params)
    said = _(SENTENCES[NoticeKind(notice.kind)])
    if notice.kind == NoticeKind.FOLLOWED:
        return _followed(said, params)
    if notice.kind == NoticeKind.RETIMED:
        return _retimed(said, params)
    if notice.kind == NoticeKind.DISQUALIFIED and "until" in notice.params:
        said = f"{said} {_(APPEAL_UNTIL if notice.params['until'] else APPEAL)}"
    if notice.kind == NoticeKind.SEASON and "left_out" in notice.params:
        said = f"{said} {_(LEFT_OUT)}"
    return said % params


_NAMES = ("race", "season", "month", "before")


def _result(said: _NoticeParams) -> str:
    """The result itself: what ranks and the place, or why there is none, and what it changed."""
    if "reason" in said:
        why = reason_sentence(said["reason"], said.get("reason_params") or {})
        return " ".join([_("Your car in %(race)s has no time.") % said, why])
    if said.get("score_ms") is None:
        text = _("Your car in %(race)s is not classified: %(streak)s of %(needed)s complete laps in a row.") % said
    elif said.get("rank") is None:
        text = _("Your car in %(race)s: %(score)s.") % _NoticeParams(said, score=clock(said["score_ms"]))
    else:
        score = _NoticeParams(said, score=clock(said["score_ms"]))
        text = _("Your car in %(race)s: %(score)s. Place %(rank)s of %(of)s.") % score
        if said.get("of") == 1:
            text = _("Your car in %(race)s: %(score)s. No rivals yet.") % score
    return " ".join([text, change_sentence(said.get("change", ""), said.get("by", 0))]).strip()


def _followed(said: str, params: _NoticeParams) -> str:
    """A lead or a win of somebody who is followed."""
    if params.get("what") in FOLLOWED_WON:
        return _(FOLLOWED_WON[params["what"]]) % params
    score = params.get("score_ms")
    return said % (params if score is None else _NoticeParams(params, score=clock(score)))


def _retimed(said: str, params: _NoticeParams) -> str:
    """Both scores with their places, and why there is none any more."""
    old, new = (_placed(params.get(f"{which}_score_ms"), params.get(f"{which}_rank")) for which in ("old", "new"))
    text = said % _NoticeParams(params, old=old, new=new)
    why = params.get("reason")
    return f"{text} {reason_sentence(why, params.get('reason_params') or {})}" if why else text


def _placed(score_ms: int | None, rank: int | None) -> str:
    if score_ms is None:
        return _("no classified time")
    if rank is None:
        return clock(score_ms)
    return _("%(score)s (place %(rank)s)") % {"score": clock(score_ms), "rank": rank}


class _NoticeParams(dict):
    def __missing__(self, key: str) -> str:
        return "–"
