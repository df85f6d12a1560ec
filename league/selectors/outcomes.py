"""What comes of a round: as it stands while it is driven, and as it becomes official at close."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import islice

from core.events import Event
from races.models import Entry, Race
from races.selectors.boards import CLASSIFIED, board_entries
from races.selectors.counting import totals_of

from ..events import IN_FINALE, PROMOTED
from ..models import ChampionshipPlace, FinalePlace, Membership, Round, Season, Stage
from ..models.season import WITH_POINTS
from ..rules import ChampionshipField, FinaleField, PointsTable, Promotion, Standings


@dataclass(frozen=True)
class BoardOutcome:
    """What the board of a round means by the season's rules. Racers by id.

    ``promoted``: place in the race and racer; ``finale``: the field, the best first; ``qualified``: for the
    championship, the winner first; ``points``: rank, racer and points of every place that has points.
    """

    promoted: list[tuple[int, int]] = field(default_factory=list)
    finale: list[int] = field(default_factory=list)
    qualified: list[int] = field(default_factory=list)
    points: list[tuple[int, int, int]] = field(default_factory=list)


@dataclass(frozen=True)
class OutcomeCut:
    """Where a board is divided. ``last_rank``: the last rank above the line, 0 while nobody is classified.

    ``racers``: ids of those whom it moves: promoted, in the finale, qualified. ``official``: whether it is so, or would
    be so if the race closed now. ``sentence``: the rule.
    """

    last_rank: int
    racers: list[int]
    official: bool
    sentence: str


def classified_order(race: Race, limit: int | None = None) -> list[int]:
    """Ids of the ranked racers of a race in its order, at most ``limit``."""
    ranked = board_entries(race).filter(CLASSIFIED, is_baseline=False).values_list("racer_id", flat=True)
    return list(ranked if limit is None else ranked[:limit])


def classified_count(race: Race) -> int:
    """How many racers of a race have a rank."""
    return totals_of(race).classified


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
    """What would be official if the round became so now. Nothing is written.

    Its own results are not taken for earlier ones: an official round's outcome is the same again. Guests keep their
    ranks; points and places they have none until somebody takes their laps over.
    """
    season, race = round_.season, round_.race
    outcome, guests = BoardOutcome(), guests_in(race)
    if round_.stage in WITH_POINTS:
        table = PointsTable(tuple(season.points))
        order = classified_order(race, len(table))
        ranked = ((rank, racer) for rank, racer in enumerate(order, start=1) if racer not in guests)
        outcome.points.extend((rank, racer, table.of(rank)) for rank, racer in ranked)
    if round_.stage == Stage.OPEN:
        rule, count = Promotion(season.promotion_percent), classified_count(race)
        order = classified_order(race, rule.places(count))
        outcome.promoted.extend(rule.promoted(order, count, _held_divisions(round_, order) | guests))
    elif round_.stage == Stage.PRO:
        qualified = _qualified_before(round_) | guests
        order = classified_order(race, season.finale_size + len(qualified))
        outcome.finale.extend(FinaleField(season.finale_size).field(order, qualified))
    elif round_.stage == Stage.FINALE:
        qualified = _qualified_before(round_) | guests
        order = classified_order(race, season.championship_places + len(qualified))
        outcome.qualified.extend(ChampionshipField(season.championship_places).qualified(order, qualified))
    return outcome


def cut_of(round_: Round) -> OutcomeCut | None:
    """The line through the board of a round, official or as it would be; None where no rule draws one."""
    season = round_.season
    official = round_.closed_at is not None
    outcome = outcome_of(round_)
    if round_.stage == Stage.OPEN:
        rule = Promotion(season.promotion_percent)
        moved = [racer for _place, racer in outcome.promoted]
        return OutcomeCut(rule.places(classified_count(round_.race)), moved, official, rule.sentence())
    if round_.stage == Stage.PRO:
        last = _rank_of_last(round_, outcome.finale)
        return OutcomeCut(last, outcome.finale, official, FinaleField(season.finale_size).sentence())
    if round_.stage == Stage.FINALE:
        last = _rank_of_last(round_, outcome.qualified)
        return OutcomeCut(last, outcome.qualified, official, ChampionshipField(season.championship_places).sentence())
    return None


def rules_of(season: Season) -> list[str]:
    """The rules of a season in sentences of the reader's language, in the order of a racer's way through it: those of
    the stages that it has, all of them before its first round."""
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
    """The stages that the rounds of a season have: one query."""
    return set(season.rounds.order_by().values_list("stage", flat=True).distinct())


def _held_divisions(round_: Round, racers: list[int]) -> set[int]:
    """Who of ``racers`` was in a division for another reason than this round."""
    members = Membership.objects.filter(season=round_.season_id).exclude(promoted_in=round_.pk)
    return set(members.values_list("racer_id", flat=True)).intersection(racers)


def _qualified_before(round_: Round) -> set[int]:
    """Ids of the racers with a championship place when the round's race closed. The finale of the same number follows
    from the round, whatever times a record gives it."""
    places = ChampionshipPlace.objects.filter(season=round_.season_id).exclude(round__number=round_.number)
    earlier = places.filter(round__race__closes_at__lte=round_.race.closes_at)
    return set(earlier.values_list("racer_id", flat=True))


def _rank_of_last(round_: Round, chosen: list[int]) -> int:
    if not chosen:
        return 0
    last = chosen[-1]
    ranked = board_entries(round_.race).filter(CLASSIFIED, is_baseline=False).values_list("racer_id", flat=True)
    return next((rank for rank, racer in enumerate(islice(ranked.iterator(), 10_000), start=1) if racer == last), 0)


def entries_of(race: Race) -> dict[int, Entry]:
    """The entries of a race by racer."""
    return {entry.racer_id: entry for entry in Entry.objects.filter(race=race)}
