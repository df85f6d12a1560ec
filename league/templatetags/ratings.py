"""Ratings from duels, for the pages of seasons and racers: nothing where there are none."""

from __future__ import annotations

from typing import Any

from django import template

from league.models import Racer, Season
from league.selectors import racer_ratings, season_ratings

register = template.Library()


@register.inclusion_tag("league/parts/season_ratings.html", takes_context=True)
def ratings_of_season(context: template.Context, season: Season) -> dict[str, Any]:
    """A card with the ratings of a season."""
    return {"ratings": season_ratings(season), "user": context.get("user")}


@register.inclusion_tag("league/parts/racer_ratings.html")
def ratings_of_racer(racer: Racer) -> dict[str, Any]:
    """A card with a racer's ratings by season."""
    return {"ratings": racer_ratings(racer)}
