"""Writes of seasons, their rounds and their divisions."""

import hashlib
from collections.abc import Iterable
from datetime import date, datetime
from typing import Any

from django.core.exceptions import ValidationError
from django.db import transaction
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.recording import audited
from paddock.errors import UserFault
from paddock.rules.race import STAGE
from races.entries.time_checks import moment
from races.errors import problem
from races.models import Race
from races.pages.services import create_league_race

from ...models import Membership, Round, Season, Stage, StageRules
from ...models.season import DIVISION_OF, WITH_FIELD
from ...standings.services import give_round_its_field
from ..selectors import cancelled_at, free_season_slug, why_kept


@audited("season.created", _("Season created"))
@transaction.atomic
def create_season(*, slug: str, name: str, starts_on: date, ends_on: date, **settings: Any) -> Season:
    """Make a season, both days included; a season at this address with only cancelled races moves to another address.

    ``settings``: any other field of a season. Raises ValidationError by field, with reason codes for contradictions.
    """
    for cancelled in cancelled_at(slug):
        Season.objects.filter(pk=cancelled.pk).update(slug=free_season_slug(f"{cancelled.slug}-cancelled"))
    season = Season(slug=slug, name=name, starts_on=starts_on, ends_on=ends_on, **settings)
    season.full_clean()
    season.save(force_insert=True)
    return season


@audited("season.deleted", _("Season deleted"), target="season")
@transaction.atomic
def delete_season(*, season: Season, now: datetime) -> None:
    """Delete a season with its races; the season before it no longer continues.

    Raises UserFault("season_has_opened" | "season_has_entries").
    """
    season = Season.objects.select_for_update().get(pk=season.pk)
    races = _unopened(season.rounds.values_list("race", flat=True), now)
    Season.objects.filter(successor=season).update(continues=False)
    season.delete()
    Race.objects.filter(pk__in=races).delete()


@audited("round.deleted", _("Round deleted"), target="round")
@transaction.atomic
def delete_round(*, round: Round, now: datetime) -> None:
    """Delete a round with its race, which has neither opened nor entries. Raises as :func:`delete_season`."""
    Season.objects.select_for_update().get(pk=round.season_id)
    races = _unopened([round.race_id], now)
    Round.objects.filter(pk=round.pk).delete()
    Race.objects.filter(pk__in=races).delete()


def _unopened(races: Iterable[int], now: datetime) -> list[int]:
    """Lock these races, so that nobody enters one of them meanwhile. Raises UserFault for the first that must stay."""
    locked = list(Race.objects.select_for_update(of=("self",)).filter(pk__in=list(races)).order_by("opens_at", "pk"))
    for race in locked:
        if (fault := why_kept(race, now)) is not None:
            raise fault
    return [race.pk for race in locked]


# What the standings of official rounds were worked out from.
FIXED_ONCE_OFFICIAL = ("promotion_percent", "finale_size", "championship_places", "points", "drop_worst")


@audited("season.changed", _("Season changed"), target="season")
@transaction.atomic
def edit_season(*, season: Season, edition: str | None = None, **changes: Any) -> Season:
    """Change any fields of a season but the address. ``edition``: see :func:`edition_of`; None overwrites other
    changes.

    Raises UserFault("season_changed_meanwhile" | "season_is_official"), ValidationError by field.
    """
    stored = Season.objects.select_for_update().get(pk=season.pk)
    if edition is not None and edition != edition_of(stored):
        raise UserFault("season_changed_meanwhile")
    before = {name: getattr(stored, name) for name in FIXED_ONCE_OFFICIAL}
    for name, value in changes.items():
        setattr(stored, name, value)
    stored.full_clean()
    moved = [name for name, value in before.items() if getattr(stored, name) != value]
    if moved and stored.rounds.filter(closed_at__isnull=False).exists():
        raise UserFault("season_is_official", fields=", ".join(moved))
    stored.save()
    return stored


def edition_of(season: Season) -> str:
    """A digest of a season's settings and rounds: another after every change and once its first round is official."""
    settings = [field.value_to_string(season) for field in Season._meta.concrete_fields if not field.primary_key]
    rounds = season.rounds.order_by("pk").values_list("pk", "number", "stage", "name", "race", "closed_at")
    listed = [row[:-1] for row in rounds]
    official = any(row[-1] is not None for row in rounds)
    return hashlib.sha256(repr((settings, listed, official)).encode()).hexdigest()[:16]


@audited("season.rules_changed", _("Rules of a stage changed"))
@transaction.atomic
def set_stage_rules(*, season: Season, stage: str, **rules: Any) -> StageRules:
    """Set how the races of a stage are ranked and limited from now on. Raises ValidationError."""
    row = StageRules.objects.filter(season=season, stage=stage).first() or StageRules(season=season, stage=stage)
    for name, value in rules.items():
        if name not in STAGE:
            raise TypeError(f"not a rule of a stage: {name}")
        setattr(row, name, value)
    row.full_clean()
    row.save()
    return row


@audited("round.created", _("Round created"))
@transaction.atomic
def schedule_round(
    *,
    season: Season,
    number: int,
    now: datetime,
    division: str = "",
    stage: str = "",
    month: str = "",
    **race: Any,
) -> Round:
    """Make a league race and the round that it is: one race for each stage and number of a season.

    ``stage``, or ``division`` for the month's open or pro race; ``month``: its name; ``race``: as for
    :func:`races.pages.services.create_league_race`, over the stage's rules. Raises RaceRefused, ValidationError.
    """
    Season.objects.select_for_update().get(pk=season.pk)  # two that are scheduled at once see each other
    if not stage:
        stage = {"open": Stage.OPEN, "pro": Stage.PRO}.get(division, Stage.SINGLE)
    rules = StageRules.objects.filter(season=season, stage=stage).first()
    fields = ({} if rules is None else rules.for_a_race()) | race
    made = create_league_race(now=now, division=division or DIVISION_OF[Stage(stage)], **fields)
    round_ = Round(season=season, number=number, stage=stage, name=month, race=made)
    round_.full_clean()
    _refuse_early_finale(round_)
    round_.save(force_insert=True)
    if stage in WITH_FIELD:
        give_round_its_field(round_, now=now)
    return round_


@audited("racer.moved", _("Racer put into a division"))
@transaction.atomic
def put_in_division(*, season: Season, racer: Racer, division: str, now: datetime) -> Membership:
    """Put a racer into a division for the rest of a season. What they have driven in the other one stays there."""
    membership = Membership.objects.select_for_update().filter(season=season, racer=racer).first()
    if membership is not None and membership.division == division:
        return membership
    membership = membership or Membership(season=season, racer=racer)
    membership.division, membership.since = division, now
    membership.promoted_in, membership.place, membership.carried = None, None, False
    membership.full_clean()
    membership.save()
    return membership


def hold_season(race: Race) -> None:
    """Lock the season of a round whose race is about to change, before the race's own lock."""
    season = Round.objects.filter(race=race.pk).values_list("season", flat=True).first()
    if season is not None:
        Season.objects.select_for_update().get(pk=season)


def check_round_times(race: Race, before: Race) -> None:
    """Raise ValidationError("rounds_overlap" | "finale_before_qualifier") on the changed time of a round's race."""
    round_ = Round.objects.filter(race=race.pk).select_related("season").first()
    if round_ is None:
        return
    round_.race = race
    try:
        round_.refuse_overlap()
        _refuse_early_finale(round_)
    except ValidationError as refused:
        field = "opens_at" if race.opens_at != before.opens_at else "closes_at"
        raise ValidationError({field: refused.error_dict["race"]}) from None


def _refuse_early_finale(round_: Round) -> None:
    """A finale opens when its qualifier has closed, whichever of the two is made or moved."""
    other = {Stage.FINALE: Stage.PRO, Stage.PRO: Stage.FINALE}.get(Stage(round_.stage))
    if other is None:
        return
    found = Round.objects.filter(
        season=round_.season, number=round_.number, stage=other, race__cancelled_at=None
    ).select_related("race")
    for one in found:
        pro, finale = (one.race, round_.race) if round_.stage == Stage.FINALE else (round_.race, one.race)
        if pro.closes_at > finale.opens_at:
            raise ValidationError({"race": problem("finale_before_qualifier", closes=moment(pro.closes_at))})
