"""Cards of racers and seasons."""

from __future__ import annotations

from django.contrib.auth.models import AnonymousUser
from django.db.models import QuerySet
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from accounts.models import Racer
from core.cards.registry import CardFigure, CardKind, CardRow, ShareCard
from core.times import written_day
from evaluation.models import TrainedModel
from league.models import Season
from league.racers.selectors import SHOWN, profile_of, racer_shown
from league.standings.selectors.months import months_of
from league.standings.selectors.tables import leaders_shown
from races.cards.runs import car_shapes
from races.models import Division, RaceState
from races.web.names import named
from tracks.drawing.cards import map_of

ROWS = 5


def _racer_card(key: str, hides: bool) -> ShareCard | None:
    racer = racer_shown(key)
    if racer is None or hasattr(racer, "learner") or racer.is_program:
        return None
    profile = profile_of(racer, AnonymousUser(), timezone.now())
    honours = profile.honours
    counts = (
        (_("Wins"), honours.wins + honours.real_wins),
        (_("Podiums"), honours.podiums + honours.real_podiums),
        (_("Races"), honours.races),
    )
    figures = tuple(CardFigure(label, str(count)) for label, count in counts if count)
    lines = tuple(text for text in profile.texts if text)[:2]
    best = [] if hides else [row for row in profile.history if row.rank is not None]
    raced = next((row.race.track for row in profile.history), None)
    newest = next((row.entry.best.evaluation for row in best if row.entry.best is not None), None)
    model = None if newest is None else TrainedModel.objects.filter(pk=newest.model_id).first()
    return ShareCard(
        _("Racer"),
        racer.shown_name,
        lines,
        () if hides else figures,
        note=_("Results are hidden until you watch the race.") if hides else "",
        picture=() if raced is None else map_of(raced),
        car=() if model is None else car_shapes(*model.look),
    )


def _racers() -> QuerySet[Racer]:
    """Racers with a page, without the accounts of classes and programs."""
    racers = Racer.objects.filter(SHOWN, is_program=False, learner=None)
    return racers.only("alias", "joined_at").order_by("pk")


def _season_card(key: str, hides: bool) -> ShareCard | None:
    season = Season.objects.filter(slug=key).first()
    if season is None:
        return None
    now = timezone.now()
    months = months_of(season)
    tables = [] if hides else leaders_shown(season, ROWS, months, now)
    rows = tuple(
        CardRow(str(place), racer.shown_name, str(line.points))
        for table in tables[:1]
        for place, (line, racer) in enumerate(table.rows, 1)
    )
    races = [one.race for month in months for one in month]
    shown = next((race for race in races if race.state_at(now) == RaceState.OPEN), races[0] if races else None)
    lines: tuple[str, ...] = (f"{written_day(season.starts_on)} – {written_day(season.ends_on)}",)
    if tables and tables[0].division != Division.ALL:
        lines = (*lines, str(tables[0].division.label))
    note = _("Results are hidden until you watch the race.") if hides else ""
    picture = () if shown is None else map_of(shown.track)
    return ShareCard(_("Season"), named(season.name), lines, rows=rows, note=note, picture=picture)


def _seasons() -> QuerySet[Season]:
    return Season.objects.order_by("pk")


KINDS = (
    CardKind("racer", gettext_lazy("Racer"), "racer", "alias", _racer_card, _racers, "joined_at", results="racer"),
    CardKind("season", gettext_lazy("Season"), "season", "slug", _season_card, _seasons, results="season"),
)
