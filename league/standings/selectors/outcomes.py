"""Outcomes of a round: provisional while it runs, official after its close."""

from dataclasses import dataclass, field

from core.events import Event
from races.boards.selectors.board import CLASSIFIED, board_entries
from races.boards.selectors.counts import totals_of
from races.models import Entry, Race

from ...events import IN_FINALE, PROMOTED
from ...models import ChampionshipPlace, FinalePlace, Membership, Round, Season, Stage
from ...models.season import WITH_POINTS
from ..rules import ChampionshipField, FinaleField, PointsTable, Promotion, Standings


@dataclass(frozen=True)
class BoardOutcome:
    """The outcome of a round by the season's rules. ``promoted``: place, racer id; ``points``: rank, racer id,
    points."""

    promoted: list[tuple[int, int]] = field(default_factory=list)
    finale: list[int] = field(default_factory=list)
    qualified: list[int] = field(default_factory=list)
    points: list[tuple[int, int, int]] = field(default_factory=list)


def classified_order(race: Race, limit: int | None = None) -> list[int]:
    """Ids of the ranked racers of a race in its order, at most ``limit``."""
    ranked = board_entries(race).filter(CLASSIFIED, is_baseline=False).values_list("racer_id", flat=True)
    return list(ranked if limit is None else ranked[:limit])


def guests_in(race: Race) -> set[int]:
    """Ids of the stand-ins of guests in a race of real cars. No query for other races."""
    if not race.physical:
        return set()
    return set(Entry.objects.filter(race=race).exclude(guest_name="").values_list("racer_id", flat=True))


def holds(event: Event) -> bool:
    """Whether a round still moves on the racer whom the event names: a correction may have undone it since."""
    if event.kind == PROMOTED.name:
        return Membership.objects.filter(promoted_in=event.data["round"], racer=event.racer_id).exists()
    model = FinalePlace if event.kind == IN_FINALE.name else ChampionshipPlace
    return model.objects.filter(round=event.data["round"], racer=event.racer_id).exists()


def outcome_of(round_: Round) -> BoardOutcome:
    """What would be official if the round became so now; the same again for an official one. Guests have ranks only."""
    season, race = round_.season, round_.race
    outcome, guests = BoardOutcome(), guests_in(race)
    if round_.stage in WITH_POINTS:
        table = PointsTable(tuple(season.points))
        order = classified_order(race, len(table))
        ranked = ((rank, racer) for rank, racer in enumerate(order, start=1) if racer not in guests)
        outcome.points.extend((rank, racer, table.of(rank)) for rank, racer in ranked)
    if round_.stage == Stage.OPEN:
        rule, count = Promotion(season.promotion_percent), totals_of(race).classified
        order = classified_order(race, rule.places(count))
        outcome.promoted.extend(rule.promoted(order, count, _held_divisions(round_, order) | guests))
    elif round_.stage == Stage.PRO:
        qualified = qualified_before(round_) | guests
        order = classified_order(race, season.finale_size + len(qualified))
        outcome.finale.extend(FinaleField(season.finale_size).chosen(order, qualified))
    elif round_.stage == Stage.FINALE:
        qualified = qualified_before(round_) | guests
        order = classified_order(race, season.championship_places + len(qualified))
        outcome.qualified.extend(ChampionshipField(season.championship_places).chosen(order, qualified))
    return outcome


def rules_of(season: Season) -> list[str]:
    """The rules of a season's stages in sentences, in the order of a racer's way through it; all before the first
    round."""
    stages = stages_of(season) or set(Stage)
    sentences = [
        (Promotion(season.promotion_percent).sentence(), {Stage.OPEN}),
        (FinaleField(season.finale_size).sentence(), {Stage.FINALE}),
        (ChampionshipField(season.championship_places).sentence(), {Stage.FINALE, Stage.CHAMPIONSHIP}),
        (PointsTable(tuple(season.points)).sentence(), set(WITH_POINTS)),
        (Standings(season.drop_worst).sentence(), set(WITH_POINTS)),
    ]
    return [sentence for sentence, needed in sentences if needed & stages]


def stages_of(season: Season) -> set[str]:
    return set(season.rounds.order_by().values_list("stage", flat=True).distinct())


def _held_divisions(round_: Round, racers: list[int]) -> set[int]:
    """The ids of ``racers`` with a division for another reason than this round."""
    members = Membership.objects.filter(season=round_.season_id).exclude(promoted_in=round_.pk)
    return set(members.values_list("racer_id", flat=True)).intersection(racers)


def qualified_before(round_: Round) -> set[int]:
    """Ids of the racers with a championship place when the race closed, except in the finale of the same number."""
    places = ChampionshipPlace.objects.filter(season=round_.season_id).exclude(round__number=round_.number)
    earlier = places.filter(round__race__closes_at__lte=round_.race.closes_at)
    return set(earlier.values_list("racer_id", flat=True))
