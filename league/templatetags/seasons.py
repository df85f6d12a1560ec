"""The season of a race on the race's pages, and ratings from duels."""

from django import template
from django.db.models import Exists, OuterRef
from django.utils import timezone
from django.utils.safestring import SafeString, mark_safe

from accounts.models import Racer
from core.streams.shared_pieces import shared_value
from league.models import Round, Season
from league.seasons.selectors import decisions_of
from league.seasons.services.race_changes import cancelling_consequences, removal_consequences
from league.standings.rules import entry_rule
from league.standings.selectors.boards import BoardCut, board_cut, round_of, season_of
from league.standings.selectors.tables import racer_ratings, season_ratings
from league.stewarding.selectors import actions_now
from races.boards.selectors.board import BoardRow
from races.boards.selectors.results import Place
from races.models import Entry, Race, RaceKind

register = template.Library()
DECISIONS, TOP_RATINGS = 20, 10


@register.simple_tag
def round_shown(race: Race) -> Round | None:
    return round_of(race)


@register.filter
def division_words(race: Race) -> str:
    """Whose a league race is and how a racer comes into it, by the rules of its season where it has one."""
    round_ = round_of(race)
    if round_ is None:
        return entry_rule(race.division, None, None)
    return entry_rule(race.division, round_.stage, round_.season)


@register.simple_tag
def to_the_line(cut: BoardCut | None, row: BoardRow | Place) -> dict[str, int]:
    """Places that a racer is ``clear`` of the qualifying line or ``short`` of it; nothing once that cannot change."""
    if cut is None or cut.official or not cut.last_rank or row.rank is None or row.entry.racer_id in cut.held:
        return {}
    places = cut.last_rank - row.rank
    return {"clear": max(0, places), "short": max(0, -places)}


@register.simple_tag
def cut_of_place(place: Place) -> BoardCut | None:
    """The line that the season draws through a board, for the place of one racer on it. None for other races."""
    round_ = round_of(place.race)
    if round_ is None:
        return None
    ranked = {} if place.rank is None else {place.entry.racer_id: place.rank}
    return board_cut(round_, place.totals.classified, ranked)


@register.inclusion_tag("league/stewarding/parts/decisions.html")
def decisions_shown(race: Race) -> dict[str, object]:
    """Since when results are official, until when they can be corrected, and what stewards decided and why."""
    round_ = round_of(race)
    if round_ is None or (round_.closed_at is None and round_.held_at is None):
        return {}
    decisions = list(decisions_of(round_)[:DECISIONS]) if round_.has_decisions else []
    return {"round": round_, "decisions": decisions, "under_review": round_.is_under_review(timezone.now())}


@register.inclusion_tag("league/stewarding/parts/stewards.html", takes_context=True)
def stewards_do(context: template.Context, race: Race) -> dict[str, object]:
    """What an admin may do with the round that a race is, each a click away from its board; nothing for others."""
    user = context.get("user")
    if not (user and user.is_staff and user.has_perm("league.change_round")):
        return {}
    round_ = round_of(race)
    return {} if round_ is None else {"round": round_, "actions": actions_now(round_, timezone.now())}


@register.simple_tag(takes_context=True)
def removal_follows(context: template.Context, entry: Entry) -> list[str]:
    """What would follow for the season if this entry were removed from its race; nothing for races of no season."""
    round_ = round_of(entry.race)
    return [] if round_ is None else removal_consequences(round_, entry, by=context["user"], now=timezone.now())


@register.simple_tag
def cancelling_follows(race: Race) -> list[str]:
    """What would follow for the season if this race were cancelled; nothing for races of no season."""
    round_ = round_of(race)
    return [] if round_ is None else cancelling_consequences(round_)


@register.simple_tag
def seasons_of(racer: Racer) -> list[Season]:
    entries = Entry.objects.filter(race__round__season=OuterRef("pk"), racer=racer, withdrawn_at=None)
    seasons = Season.objects.filter(Exists(entries)).order_by("-starts_on", "-pk")
    return shared_value(("seasons of", racer.pk), lambda: list(seasons))


@register.filter
def drawn(svg: str) -> SafeString:
    """A drawing of league.seasons.progress_chart, whose texts are escaped where it is made."""
    return mark_safe(svg)


@register.inclusion_tag("league/standings/parts/race_ratings.html", takes_context=True)
def ratings_of_race(context: template.Context, race: Race) -> dict[str, object]:
    """A small card with the best ratings of the season that a race is a round of."""
    season = season_of(race) if race.kind == RaceKind.LEAGUE else None
    ratings = season_ratings(season, TOP_RATINGS) if season else []
    return {"ratings": ratings, "season": season, "user": context.get("user")}


@register.inclusion_tag("league/standings/parts/racer_ratings.html")
def ratings_of_racer(racer: Racer) -> dict[str, object]:
    return {"ratings": shared_value(("ratings of", racer.pk), lambda: racer_ratings(racer))}
