"""Two sites for :mod:`benchmarks.pages`: the first season of a new installation, and one with a history."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from .board import oval
from .board_rows import counted_at_the_end, fill, insert, make_race, make_racers, series

RACERS, RACES, RUNS = 2_000, 200, 50_000
MONTHS_BEFORE = 150  # days since the large site's season began
MODELS = 3  # of each racer; so many runs in a race at most
NOTICES = 20
OWN_RUNS, ITERATIONS = 3, 60  # of the racer with results
BOARD = 120  # entries of the new site's long board: a further page has some
LAP_MS = 15_000


@dataclass(frozen=True)
class Site:
    """Readers by name (None: a guest), and the addresses of pages by name, with words for what is a reader's own."""

    readers: dict[str, Any]
    others: dict[str, Any]  # another reader of each kind
    paths: dict[str, str]
    month: Any  # the race of the month in the open division
    owned: dict[int, dict[str, str]]  # by racer the words of addresses

    def path(self, page: str, racer: Any) -> str:
        return self.paths[page].format(**self.owned.get(racer and racer.pk, {}))


def make_site(now: datetime, *, big: bool = False, racers: int = RACERS, races: int = RACES, runs: int = RUNS) -> Site:
    """Fill an empty database: the demo season with its house cars as ``manage.py run`` opens it, readers with and
    without cars, a live event, a board of several pages; with ``big`` also a history of so many ``racers``, ``races``
    and ``runs``."""
    from accounts.following import follow_racer
    from accounts.models import Racer
    from league.house_cars.services import enter_house_cars
    from league.models import Stage
    from league.seasons.services.demo_season import open_demo_season
    from races.entries.services.submissions import submit_model
    from races.models import Race
    from tests.factories import a_model, a_racer
    from tests.happened import tell_what_happened
    from tests.live_shows import a_live_race, an_ended_show

    season = open_demo_season(now=now - timedelta(days=MONTHS_BEFORE if big else 0))
    month = Race.objects.get(round__season=season, round__stage=Stage.OPEN, opens_at__lte=now, closes_at__gt=now)
    if big:
        _fill_history(season, now, racers, races, runs)
    readers = {name: a_racer(name.replace(" ", "-")) for name in ("no car", "waiting car", "results", "organiser")}
    readers["admin"] = a_racer("admin-anna", is_staff=True, is_superuser=True)
    board = make_race("long-board", oval(), now)
    Race.objects.filter(pk=board.pk).update(organiser=readers["organiser"])
    with counted_at_the_end():
        if not big:
            make_racers(BOARD, now)
        fill(board, BOARD, now)
    enter_house_cars(now=now)
    _end_queued(now)
    others = {name: _like(racer) for name, racer in readers.items()}
    other_run, run = [_drive(month, each["results"], now) for each in (others, readers)]
    for race in list(Race.objects.filter(round=None, opens_at__lte=now, closes_at__gt=now, race_type="time_trial")[:3]):
        _drive(race, readers["results"], now)
    for follower, followed in ((readers, others), (others, readers)):
        follow_racer(follower=follower["results"], racer=Racer.objects.get(alias="r1"), now=now)
        follow_racer(follower=follower["results"], racer=followed["results"], now=now)
    owned = {each["results"].pk: _own_rows(each["results"], run, now) for each in (others, readers)}
    for waiting in (others["waiting car"], readers["waiting car"]):
        submit_model(race=month, racer=waiting, model=a_model(waiting), now=now)
    show = a_live_race(now, readers["organiser"], slug="live-show", name="Live show")
    an_ended_show(now - timedelta(minutes=30), readers["organiser"], race=show, end=False, laps=_laps_of_the_show())
    tell_what_happened(now=now)
    paths = {
        "home": "/",
        "races": "/races/",
        "race": month.get_absolute_url(),
        "race with an organiser": board.get_absolute_url(),
        "board, page 2": f"{(month if big else board).get_absolute_url()}?page=2",
        "run": run.get_absolute_url(),
        "garage": "/models/",
        "seasons": "/seasons/",
        "season": season.get_absolute_url(),
        "live event": f"{show.get_absolute_url()}event/",
        "notices": "/notices/",
        "wizard": "/train/new/",
        "wizard, clone": "/train/new/?clone={model}",
        "training": "/train/{training}/",
        "model": "/models/{model}/",
        "own runs": "/runs/",
        "new run": "/runs/new/",
        "comparison": f"{run.get_absolute_url()}replay/?with={other_run.public_id}",
        "following": "/following/",
        "usage": "/settings/usage/",
        "usage of all": "/usage/",
        "admin: races": "/admin/races/race/",
        "admin: race": f"/admin/races/race/{month.pk}/change/",
        "admin: racers": "/admin/accounts/racer/",
        "admin: racer": f"/admin/accounts/racer/{readers['results'].pk}/change/",
        "admin: runs": "/admin/evaluation/evaluation/",
        "admin: run": f"/admin/evaluation/evaluation/{run.pk}/change/",
    }
    return Site({"guest": None, **readers}, {"guest": None, **others}, paths, month, owned)


def _own_rows(racer: Any, run: Any, now: datetime) -> dict[str, str]:
    """Test drives and an ended training of the racer, with a graph. Returns the words of addresses."""
    from evaluation.models import TrainedModel
    from races.test_runs.services import drive_own
    from tests.factories import finish, laps
    from tests.training.jobs import a_trained_one, an_iteration
    from training.models import JobState, TrainingIteration, TrainingJob

    model = TrainedModel.objects.filter(owner=racer).earliest("pk")
    for _ in range(OWN_RUNS):
        finish(drive_own(owner=racer, model=model, track=run.track, now=now), laps(*[LAP_MS] * 3), now)
    training = a_trained_one(racer, run.track, now)
    ended = {"state": JobState.STOPPED, "ended_because": "stopped", "started_at": now, "ended_at": now}
    TrainingJob.objects.filter(pk=training.pk).update(**ended)
    numbers = range(4, ITERATIONS)
    TrainingIteration.objects.bulk_create(
        TrainingIteration(job=training, **an_iteration(number, is_best=number == ITERATIONS - 1).values)
        for number in numbers
    )
    return {"model": model.public_id, "training": training.public_id}


def _laps_of_the_show() -> dict[str, tuple[int, ...]]:
    return {"results": (9_000, 9_400), "carl": (8_000,), "dora": (8_500, 10_000, 8_700)}


def _like(racer: Any) -> Any:
    from tests.factories import a_racer

    return a_racer(f"other-{racer.alias}", is_staff=racer.is_staff, is_superuser=racer.is_superuser)


def _drive(race: Any, racer: Any, now: datetime) -> Any:
    """A finished run of a new car, with laps round the track."""
    from tests.drawn_runs import a_driven_run

    return a_driven_run(race, racer, now, lap_ms=LAP_MS)


def _end_queued(now: datetime) -> None:
    """End all runs that wait, as a worker would."""
    from races.models import Submission
    from tests.factories import finish, laps

    for number, submission in enumerate(Submission.objects.filter(evaluation__state="queued")):
        finish(submission, laps(*[LAP_MS + 100 * number] * 3), now)


def _fill_history(season: Any, now: datetime, racers: int, races: int, runs: int) -> None:
    """Everybody in all open rounds until now, made official, and the other runs in community races."""
    from league.models import Stage
    from league.stewarding.official_results import close_due_rounds
    from races.models import Race

    make_racers(racers, now)
    _models_and_notices(racers, now)
    rounds = Race.objects.filter(round__season=season, round__stage=Stage.OPEN, opens_at__lte=now).order_by("opens_at")
    with counted_at_the_end():
        done = 0
        for race in rounds:
            done += _runs(race, racers, 2, done, min(race.closes_at - timedelta(hours=1), now))
        community = races - Race.objects.count()
        each = (runs - done) // (community * MODELS) * 10 // 9  # nine in ten of a board have run
        for number in range(community):
            begun = now - timedelta(days=MONTHS_BEFORE * number // community)
            race = make_race(f"community-{number}", oval(), begun)
            done += _runs(race, min(each, racers), MODELS, done, begun)
    close_due_rounds(now=now)


def _models_and_notices(racers: int, now: datetime) -> None:
    from accounts.models import Racer
    from evaluation.models import Network, TrainedModel
    from league.models import Notice
    from tests.rows import METADATA

    first = Racer.objects.get(alias="r0").pk
    digest = f"substr('{'0' * 64}' || n, 1 + length(CAST(n AS text)))"
    numbers = f"({series(racers * MODELS)}) AS numbers"
    fixed: dict[str, Any] = {"size": 100, "parameters": 10, "macs": 100, "created_at": now}
    insert(Network, {"sha256": digest, "onnx": "'networks/' || n"}, fixed, numbers)
    values = {"public_id": "'m' || n", "owner": f"{first} + n / {MODELS}", "name": f"'Car ' || (n % {MODELS})"}
    fixed = {"metadata": METADATA, "source_kind": "onnx", "created_at": now}
    insert(TrainedModel, values | {"network": digest, "source_sha256": digest}, fixed, numbers)
    values = {"racer": f"{first} + n / {NOTICES}", "about": "'result ' || n"}
    fixed = {"kind": "result", "params": {"race": "Race"}, "at": now, "path": "/races/"}
    insert(Notice, values, fixed, f"({series(racers * NOTICES)}) AS numbers")


def _runs(race: Any, count: int, each: int, before: int, at: datetime) -> int:
    """Entries of the first ``count`` racers with ``each`` finished runs, if classified. Returns the number of runs."""
    from django.db.models import Max, OuterRef, Subquery

    from accounts.models import Racer
    from evaluation.models import Evaluation, Result, TrainedModel
    from paddock.simulator import engine
    from races.models import Entry, Submission
    from races.rules.layout import race_rules
    from tests.factories import laps
    from tests.rows import METADATA

    fill(race, count, at)
    entered = Entry.objects.filter(race=race, classified=True)
    first, model = Racer.objects.get(alias="r0").pk, TrainedModel.objects.get(public_id="m0").pk
    source = (
        f"(SELECT e.id AS entry, {model} + (e.racer_id - {first}) * {MODELS} + t.n AS model, e.racer_id AS racer, "
        f"t.n + 1 AS number, row_number() OVER (ORDER BY e.id, t.n) - 1 AS n FROM races_entry e "
        f"CROSS JOIN ({series(each)}) t WHERE e.race_id = {race.pk} AND e.classified) AS runs"
    )
    spec = {"track": race.track.fingerprint, "rules": race_rules(race).to_dict(), "metadata": METADATA}
    times = dict.fromkeys(("queued_at", "started_at", "ended_at"), at)
    fixed: dict[str, Any] = {"track": race.track_id, "spec": spec, "state": "finished", "attempt": 1, **times}
    insert(Evaluation, {"public_id": f"'e' || ({before} + n)", "owner": "racer", "model": "model"}, fixed, source)
    run = f"{Evaluation.objects.get(public_id=f'e{before}').pk} + n"
    network = "(SELECT network_id FROM evaluation_trainedmodel m WHERE m.id = model)"
    values = {"entry": "entry", "number": "number", "evaluation": run, "network": network}
    insert(Submission, values, {"submitted_at": at}, source)
    fixed = {"laps": laps(20_000, 21_000, 22_000), "end_reason": "laps_done", "complete_laps": 3, "metrics": {}}
    fixed |= {"trajectory": [[[x / 10, 1.0, 2.5] for x in range(40)]] * 3, "trace_sha256": "0" * 64, "wall_s": 1.0}
    fixed |= {"best_lap_ms": 20_000, "total_ms": 63_000, "simulated_ms": 63_000, "peak_mb": 1.0, "versions": {}}
    insert(Result, {"evaluation": run}, fixed | {"engine": engine.ENGINE_ID, "created_at": at}, source)
    of_entry = Submission.objects.filter(entry=OuterRef("pk")).values("entry").annotate(last=Max("pk")).values("last")
    entered.update(best=Subquery(of_entry), submission_count=each, last_number=each)
    return entered.count() * each
