"""The reader of events that closes rounds, corrects official ones and rates duels."""

from datetime import datetime

from core.events import Event, EventReader
from evaluation.running.events import RUN_FAILED
from races.events import DUELS_OVER, RACE_CLOSED, RACE_RESULT, RACE_TIMED
from races.models import Submission

from ..models import Round
from ..standings.services import rate_season
from ..stewarding.official_results import close_due_rounds
from ..stewarding.services import correct_results


def _follow(event: Event, now: datetime) -> int:
    race = event.race
    if event.kind == RUN_FAILED.name:
        raced = Submission.objects.filter(evaluation__public_id=event.subject)
        race = raced.values_list("entry__race", flat=True).first()
    round_ = Round.objects.filter(race=race).select_related("season", "race").first()
    if round_ is None:
        return 0
    if event.kind == DUELS_OVER.name:
        rate_season(season=round_.season)
    if round_.closed_at is not None:
        # a car that was timed again after its round became official, while the window was open
        correct_results(round=round_, now=event.at)
        return 0
    return len(close_due_rounds(now=now, season=round_.season))


# The reader returns how many rounds it closed.
SEASONS = EventReader("seasons", (RACE_CLOSED, RACE_RESULT, RACE_TIMED, RUN_FAILED, DUELS_OVER), _follow)
