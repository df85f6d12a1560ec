"""The sentences of notices, in the reader's language."""

from __future__ import annotations

from django.utils.translation import gettext as _
from django.utils.translation import gettext_noop

from core.jobs.models import reason_sentence
from core.times import clock, for_the_reader
from core.validators import isolated
from races.boards.improvement import sentence as change_sentence
from races.web.names import named

from ..models import Notice
from . import kinds

# Added to the notice of a drafted season.
LEFT_OUT = gettext_noop("Races that could not be copied: %(left_out)s.")
# Other results of a followed racer, by ``params["what"]``.
FOLLOWED_WON = {
    "race": gettext_noop("%(racer)s has won %(race)s."),
    "cup": gettext_noop("%(racer)s has won division %(division)s of the cup of %(day)s."),
}
# What a racer can do about it. Shown while it can be changed: "until" is empty before the results are official.
APPEAL = gettext_noop("If this is a mistake, contact the organisers. They can reinstate you.")
APPEAL_UNTIL = gettext_noop("If this is a mistake, contact the organisers. They can reinstate you until %(until)s.")


def sentence(notice: Notice) -> str:
    """The sentence of a notice. Missing parameters of old notices become dashes."""
    names = {key: named(notice.params[key]) for key in _NAMES if isinstance(notice.params.get(key), str)}
    values = {key: for_the_reader(value) for key, value in notice.params.items()} | names
    params = _NoticeParams({key: isolated(value) if isinstance(value, str) else value for key, value in values.items()})
    if notice.kind == kinds.RESULT and len(notice.params) > 1:
        return _result(params)
    text = _(kinds.KINDS[notice.kind].sentence)
    if notice.kind == kinds.FOLLOWED:
        return _followed(text, params)
    if notice.kind == kinds.RETIMED:
        return _retimed(text, params)
    if notice.kind == kinds.DISQUALIFIED and "until" in notice.params:
        text = f"{text} {_(APPEAL_UNTIL if notice.params['until'] else APPEAL)}"
    if notice.kind == kinds.SEASON and "left_out" in notice.params:
        text = f"{text} {_(LEFT_OUT)}"
    return text % params


_NAMES = ("race", "season", "month", "before")


def _result(params: _NoticeParams) -> str:
    """The result itself: what ranks and the place, or why there is none, and what it changed."""
    if "reason" in params:
        why = reason_sentence(params["reason"], params.get("reason_params") or {})
        return " ".join([_("Your car in %(race)s has no time.") % params, why])
    if params.get("score_ms") is None:
        text = _("Your car in %(race)s is not classified: %(streak)s of %(needed)s complete laps in a row.") % params
    elif params.get("rank") is None:
        text = _("Your car in %(race)s: %(score)s.") % _NoticeParams(params, score=clock(params["score_ms"]))
    else:
        score = _NoticeParams(params, score=clock(params["score_ms"]))
        text = _("Your car in %(race)s: %(score)s. Place %(rank)s of %(of)s.") % score
        if params.get("of") == 1:
            text = _("Your car in %(race)s: %(score)s. No rivals yet.") % score
    return " ".join([text, change_sentence(params.get("change", ""), params.get("by", 0))]).strip()


def _followed(text: str, params: _NoticeParams) -> str:
    if params.get("what") in FOLLOWED_WON:
        return _(FOLLOWED_WON[params["what"]]) % params
    score = params.get("score_ms")
    return text % (params if score is None else _NoticeParams(params, score=clock(score)))


def _retimed(sentence: str, params: _NoticeParams) -> str:
    """Both scores with their places, and why there is none any more."""
    old, new = (_placed(params.get(f"{which}_score_ms"), params.get(f"{which}_rank")) for which in ("old", "new"))
    text = sentence % _NoticeParams(params, old=old, new=new)
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
