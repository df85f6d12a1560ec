"""Ratings from duels, for the pages of seasons and racers: nothing where there are none."""

from __future__ import annotations

from typing import Any

from django import template

from accounts.models import Racer
from league.models import Season
from league.selectors import racer_ratings, season_of, season_ratings
from races.models import Race, RaceKind

register = template.Library()
TOP = 10


@register.inclusion_tag("league/parts/season_ratings.html", takes_context=True)
def ratings_of_season(context: template.Context, season: Season) -> dict[str, Any]:
    """A card with the ratings of a season."""
    return {"ratings": season_ratings(season), "user": context.get("user")}


@register.inclusion_tag("league/parts/race_ratings.html", takes_context=True)
def ratings_of_race(context: template.Context, race: Race) -> dict[str, Any]:
    """A small card with the best ratings of the season that a race is a round of."""
    season = season_of(race) if race.kind == RaceKind.LEAGUE else None
    ratings = season_ratings(season, TOP) if season else []
    return {"ratings": ratings, "season": season, "user": context.get("user")}


@register.inclusion_tag("league/parts/racer_ratings.html")
def ratings_of_racer(racer: Racer) -> dict[str, Any]:
    """A card with a racer's ratings by season."""
    return {"ratings": racer_ratings(racer)}
