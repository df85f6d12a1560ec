"""Race titles for the videos of runs (see :mod:`videos.hooks`)."""

from collections.abc import Sequence

from django.utils import translation

from evaluation.models import Evaluation
from videos.hooks import Runs, register_runs

from ..boards.ranking import standing_in
from ..entries.selectors.visibility import can_see_evaluation, evaluations_visible_to
from ..models import Duel, Race, Submission
from ..replays.selectors import race_of
from ..rules.live_start import begins_elsewhere
from ..web.names import named, names_track


def titles_of(evaluation: Evaluation, language: str) -> tuple[str, str]:
    """The race's name and, unless it names it, the track's; of a test drive the track's alone."""
    track, race = evaluation.track.name, race_of(evaluation)
    if race is None:
        return track, ""
    with translation.override(language):
        name = named(race.name)
    return name, "" if names_track(race.name, track) else track


def race_of_marks(evaluation: Evaluation) -> Race | None:
    """The race whose fastest times decide a run's purple laps; None if unclassified, of another engine, a house car's,
    a test drive or of a live event with another start."""
    if begins_elsewhere(evaluation):
        return None
    submission, duel = getattr(evaluation, "submission", None), getattr(evaluation, "duel", None)
    if submission is None:
        return None if duel is None else duel.race
    entry = submission.entry
    if entry.is_baseline or evaluation.result.engine != entry.race.engine:
        return None
    standing = standing_in(entry.race, evaluation.result.laps)
    return entry.race if standing.classified else None


def fastest_sectors_of(evaluation: Evaluation) -> Sequence[int | None]:
    """The fastest sectors (ms or None) of the race that decides the run's marks; empty without marks."""
    marked = race_of_marks(evaluation)
    return marked.fastest_sectors_ms if marked else ()


def shown_together(runs: Sequence[str]) -> bool:
    """Whether all these runs were shown in one race and still count there: none of their racers has left it."""
    wanted = set(runs)
    sent = Submission.objects.filter(evaluation__public_id__in=wanted, is_live=True, entry__withdrawn_at=None)
    found = dict(sent.values_list("evaluation__public_id", "entry__race"))
    found |= dict(Duel.objects.filter(evaluation__public_id__in=wanted).values_list("evaluation__public_id", "race"))
    return set(found) == wanted and len(set(found.values())) == 1


def register() -> None:
    register_runs(
        Runs(
            can_see=can_see_evaluation,
            visible_to=evaluations_visible_to,
            titles=titles_of,
            fastest_sectors_ms=fastest_sectors_of,
            shown_together=shown_together,
            related=("evaluation__submission__entry__race", "evaluation__duel__race"),
        )
    )
