"""The stream topics of races and runs (:mod:`core.streams`), and the events that update them."""

from collections import defaultdict
from collections.abc import Iterable, Sequence

from core.events import Event
from core.streams import Topic, register_moves, register_topic
from core.streams.topics import Viewer
from evaluation.models import Evaluation
from evaluation.running.events import RUN_FAILED, RUN_FINISHED, RUN_QUEUED, RUN_STARTED, RUN_STOPPED
from videos.events import VIDEO_READY

from . import events as kinds
from .entries.selectors.visibility import can_see_evaluation, can_see_race
from .live.streaming import camera as live_seen_stream
from .live.streaming.event_stream import source, welcome
from .models import Duel, Race, Submission, Visibility
from .web.spectator_links import may_watch, tokens_of_viewer

RACES = "races"  # all public races and what is on track there
_OF_RUNS = {kind.name for kind in (RUN_QUEUED, RUN_STARTED, RUN_FINISHED, RUN_FAILED, RUN_STOPPED)}
_LIVE_KINDS = (kinds.LIVE_CHANGED, kinds.LIVE_PLANNED, kinds.LIVE_SHOWN, kinds.DUELS_DRAWN, kinds.DUEL_DECIDED)
_OF_LIVE = {kind.name for kind in (*_LIVE_KINDS, kinds.DUELS_OVER, kinds.RACE_BOARD, kinds.RACE_CANCELLED)}


def register() -> None:
    """Register the topics ``race``, ``run``, ``live`` (playback), ``sees`` (camera views) and ``races``, and their
    moves."""
    register_topic(Topic("race", _watches_race))
    register_topic(Topic("live", _watches_race, welcome, source))
    register_topic(Topic("sees", _watches_race, source=live_seen_stream.source))
    register_topic(Topic("run", _sees_run))
    register_topic(Topic(RACES, lambda viewer, key: not key))
    register_moves(moves)


def moves(events: Sequence[Event]) -> dict[int, set[str]]:
    """A run's event changes the run's topic and its race's: the cars on track and next there."""
    moved: dict[int, set[str]] = {event.pk: set() for event in events}
    runs = {event.pk: event.subject for event in events if event.kind in _OF_RUNS}
    live = {event.pk for event in events if event.kind in _OF_LIVE}
    in_races = _races_of(runs.values()) if runs else {}
    touched: dict[int, set[int]] = {event.pk: set() for event in events}
    for event in events:
        if event.race is not None:
            touched[event.pk].add(event.race)
        if event.pk in runs:
            moved[event.pk].add(f"run:{event.subject}")
            touched[event.pk] |= in_races.get(event.subject, set())
        elif event.kind == VIDEO_READY.name:
            moved[event.pk].add(f"run:{event.subject}")
    everywhere = {race for races in touched.values() for race in races}
    public = set(Race.objects.filter(pk__in=everywhere, visibility=Visibility.PUBLIC).values_list("pk", flat=True))
    for pk, races in touched.items():
        moved[pk] |= {f"race:{race}" for race in races}
        if pk in live:
            moved[pk] |= {f"live:{race}" for race in races}
        if races & public:
            moved[pk].add(RACES)
    return moved


def _races_of(runs: Iterable[str]) -> dict[str, set[int]]:
    found: dict[str, set[int]] = defaultdict(set)
    wanted = list(runs)
    sent = Submission.objects.filter(evaluation__public_id__in=wanted)
    duels = Duel.objects.filter(evaluation__public_id__in=wanted)
    for run, race in (
        *sent.values_list("evaluation__public_id", "entry__race_id"),
        *duels.values_list("evaluation__public_id", "race_id"),
    ):
        found[run].add(race)
    return found


def _watches_race(viewer: Viewer, key: str) -> bool:
    race = Race.objects.filter(pk=int(key)).first() if key.isdecimal() and len(key) < 16 else None
    return race is not None and (can_see_race(viewer, race) or may_watch(tokens_of_viewer(viewer), race))


def _sees_run(viewer: Viewer, key: str) -> bool:
    run = Evaluation.objects.filter(public_id=key).first()
    return run is not None and can_see_evaluation(viewer, run)
