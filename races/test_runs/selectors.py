"""A racer's own runs: the list, and a run's result by the rules of its race."""

from collections.abc import Sequence
from dataclasses import dataclass

from django.contrib.auth.models import AnonymousUser
from django.db.models import Exists, OuterRef, QuerySet

from accounts.models import Racer
from core.forms import explain
from evaluation.models import Evaluation, Result, TrainedModel
from evaluation.running.queue.selectors import can_stop_evaluation
from evaluation.selectors import visible_models
from paddock.errors import UserFault

from ..boards.improvement import Change, change
from ..boards.ranking import Standing, standing_in
from ..boards.selectors.board import has_rank
from ..boards.selectors.counts import racers_before, totals_of
from ..entries.selectors.visibility import can_see_race, races_visible_to
from ..models import Draw, Entry, OwnEvaluation, Race
from ..rules.layout import race_rules

RELATED = ("evaluation__track", "evaluation__model__owner", "evaluation__result", "race")


_FILTERS = {
    "state": "evaluation__state",
    "race_type": "evaluation__spec__rules__race_type",
    "track": "evaluation__track__slug",
    "model": "evaluation__model__public_id",
    "race": "race__slug",
}


def own_runs_of(racer: Racer | AnonymousUser, **only: str) -> QuerySet[OwnEvaluation]:
    """The racer's own runs, the latest request first; empty for anonymous readers. Twin of :func:`is_own_of`. ``only``:
    a ``state``, a ``race_type``, a ``track`` or a ``race`` by its slug, a ``model`` by its public id. Each run with
    ``sees_race``, for :func:`seen_race_of`."""
    runs = OwnEvaluation.objects.filter(deleted_at=None, owner_id=racer.pk).select_related(*RELATED)
    runs = runs.filter(**{_FILTERS[name]: value for name, value in only.items()})
    runs = runs.annotate(sees_race=Exists(races_visible_to(racer).filter(pk=OuterRef("race"))))
    return runs.defer("evaluation__result__trajectory", "evaluation__track__npy").order_by("-asked_at", "-pk")


def seen_race_of(own: OwnEvaluation) -> Race | None:
    """The race that a run was driven as in, as long as its racer sees that."""
    if own.race is None:
        return None
    seen = own.sees_race if hasattr(own, "sees_race") else can_see_race(own.owner, own.race)
    return own.race if seen else None


def own_of(racer: Racer, evaluation: Evaluation) -> OwnEvaluation:
    """The racer's own run that an evaluation is. Raises UserFault("own_only") for any other."""
    own: OwnEvaluation | None = getattr(evaluation, "own", None)
    if own is None or not is_own_of(racer, own):
        raise UserFault("own_only")
    return own


def usable_model(racer: Racer, public_id: str) -> TrainedModel:
    """A model that the racer may drive. Raises UserFault("own_model_gone")."""
    model = visible_models(racer).filter(public_id=public_id).first()
    if model is None:
        raise UserFault("own_model_gone")
    return model


def usable_rivals(racer: Racer, public_ids: Sequence[str]) -> list[TrainedModel]:
    """Models that the racer may drive against, in this order. Raises UserFault("own_rival_gone")."""
    found = {model.public_id: model for model in visible_models(racer).filter(public_id__in=public_ids)}
    for number, public_id in enumerate(public_ids, 1):
        if public_id not in found:
            raise UserFault("own_rival_gone", number=number)
    return [found[public_id] for public_id in public_ids]


def usable_race(racer: Racer, slug: str) -> Race:
    """A race that the racer sees. Raises UserFault("own_race_gone")."""
    race = races_visible_to(racer).filter(slug=slug).first()
    if race is None:
        raise UserFault("own_race_gone")
    return race


def is_own_of(racer: Racer | AnonymousUser, own: OwnEvaluation) -> bool:
    """Whether the racer may repeat and delete the run: its owner, until it is deleted."""
    return racer.pk is not None and own.owner_id == racer.pk and own.deleted_at is None


def can_stop_run(racer: Racer | AnonymousUser, evaluation: Evaluation) -> bool:
    """Whether the racer may stop a queued or running run: their own with any rivals, and by
    :func:`evaluation.running.queue.selectors.can_stop_evaluation`."""
    if can_stop_evaluation(racer, evaluation):
        return True
    own = getattr(evaluation, "own", None)
    return own is not None and is_own_of(racer, own) and not evaluation.is_final


@dataclass(frozen=True)
class WouldBe:
    """The result of a run in a race, if it were submitted now: its place, the number of racers, and the comparison with
    the racer's result there."""

    rank: int
    racers: int
    change: Change


@dataclass(frozen=True)
class OwnResult:
    """The worth of a finished test drive. ``race``: the race of its rules, if the reader sees it; ``would_be``: also
    None if the run has no place there, for the reason ``fault``."""

    own: OwnEvaluation
    standing: Standing
    race: Race | None = None
    would_be: WouldBe | None = None
    fault: UserFault | None = None

    @property
    def problem(self) -> str:
        """Why it has no place in its race, in the reader's language, or ``""``."""
        return "" if self.fault is None else explain(self.fault)


def own_result(own: OwnEvaluation, result: Result) -> OwnResult:
    """The worth of a run: no query without a race, a handful on a board of any length with one."""
    race = seen_race_of(own)
    if race is None:
        return OwnResult(own, standing_in(own.as_race, result.laps))
    standing = standing_in(race, result.laps)
    fault = _not_comparable(own, race, result)
    if fault is not None or not standing.classified:
        return OwnResult(own, standing, race, fault=fault)
    mine = _entry(own, race)
    return OwnResult(own, standing, race, _would_be(race, standing, mine))


def fault_of_better(own: OwnEvaluation, result: Result) -> UserFault | None:
    """The reason against submitting a finished run to its race: other rules than the race's (now), unclassified, or no
    better than the racer's result there. None if it should be submitted."""
    race = own.race
    assert race is not None, "the caller has looked"
    fault = _not_comparable(own, race, result)
    if fault is not None:
        return fault
    standing = standing_in(race, result.laps)
    if not standing.classified:
        return UserFault("own_not_classified")
    if not change(standing, _standing_of(_entry(own, race))).is_better:
        return UserFault("own_not_better")
    return None


def is_as_in(own: OwnEvaluation, race: Race) -> bool:
    """Whether the run equals the race's runs now: same track and rules, no rivals."""
    evaluation = own.evaluation
    assert evaluation is not None, "it is not deleted"
    same_track = evaluation.track_id == race.track_id and evaluation.spec["track"] == race.track.fingerprint
    return same_track and own.rules == race_rules(race)


def _not_comparable(own: OwnEvaluation, race: Race, result: Result) -> UserFault | None:
    if not is_as_in(own, race):
        return UserFault("own_race_changed")
    if race.engine not in ("", result.engine):
        return UserFault("own_other_engine", engine=race.engine, site=result.engine)
    if Draw.objects.filter(race=race).exists():
        return UserFault("duels_drawn")
    return None


def _entry(own: OwnEvaluation, race: Race) -> Entry | None:
    return Entry.objects.select_related("best__evaluation__result").filter(race=race, racer=own.owner_id).first()


def _standing_of(entry: Entry | None) -> Standing | None:
    """The counted standing of an entry."""
    if entry is None or entry.best is None:
        return None
    return standing_in(entry.race, entry.best.evaluation.result.laps)


def _would_be(race: Race, standing: Standing, mine: Entry | None) -> WouldBe:
    ahead = racers_before(race, standing.key)
    others = totals_of(race).racers
    if mine is not None and not mine.is_withdrawn and not mine.is_baseline:
        others -= 1
        if has_rank(mine) and (mine.rank_score, mine.rank_lap, mine.resets) <= standing.key:
            ahead -= 1  # the run would take the place of this one
    if mine is not None:
        mine.race = race
    return WouldBe(ahead + 1, others + 1, change(standing, _standing_of(mine)))
