"""What every test may use."""

from __future__ import annotations

import fcntl
import gc
import os
import re
import shutil
import signal
from collections import Counter
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from functools import partial
from math import inf
from pathlib import Path

import pytest
from django.db import connection
from django.utils import translation

from paddock.simulator import compiled
from tests import costs, database, emptied, kept, postgres
from tests.pages import browsing

PACK = 20
LONGEST = ("training", "run")
JOURNEYS = "slow and not soak"  # of the Makefile
# in every file with a test that is slow: tests/pages/browsing.py has the other word for it
NAMES_SLOW = re.compile(r"\bslow\b|\bIN_A_BROWSER\b")


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(costs.Watch())
    # a shell's background job ignores these, and programs that tests start and interrupt would inherit that
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for name in (signal.SIGQUIT, signal.SIGHUP):
        signal.signal(name, signal.SIG_DFL)
    gc.set_threshold(50_000, 20, 50)  # collecting makes much that stays
    # a camera compiled of another source than the present one draws by numpy, which takes tests minutes
    if not hasattr(config, "workerinput"):
        compiled.main()


def pytest_unconfigure(config: pytest.Config) -> None:
    """Delete the tests' data folder (tests/settings.py made it) once the last process has ended."""
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ["PADDOCK_TEST_DATA"], ignore_errors=True)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Journeys are in a quarter of the files: reading the others takes a process 15 seconds."""
    if config.getoption("markexpr") == JOURNEYS and collection_path.name.startswith("test_"):
        return True if not _names_slow(collection_path) else None
    return None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """How ``make test`` deals tests out to its workers: first the longest groups; then those in a browser, by file;
    then slow ones, each by itself, so that no worker is left with a long one at the end; then the others, in packs of
    a file, which is cheaper than one by one.

    Tests that share what their module or package makes once stay together: elsewhere every worker would make it anew.
    """
    marks = {item: {mark.name for mark in item.iter_markers()} for item in items}  # asked for many times each
    for file in {item.path for item in items if "slow" in marks[item]}:
        if not _names_slow(file):
            raise pytest.UsageError(f"{file} has slow tests and does not name the mark: journeys would not find them")
    quick_ones: Counter[str] = Counter()
    for item in items:
        if "xdist_group" in marks[item]:
            continue
        file = item.nodeid.partition("::")[0]
        scopes = _scopes(item)
        if "package" in scopes:
            item.add_marker(pytest.mark.xdist_group(file.rpartition("/")[0]))
        elif "module" in scopes or "browser" in marks[item]:
            item.add_marker(pytest.mark.xdist_group(file))
        elif marks[item].isdisjoint(costs.SLOW):
            item.add_marker(pytest.mark.xdist_group(f"{file} {quick_ones[file] // PACK}"))
            quick_ones[file] += 1
    if hasattr(config, "workerinput"):
        items.sort(key=lambda item: _turn(item, marks[item]))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object | None:
    if config.getvalue("dist") != "loadgroup":
        return None
    from tests.groups import GroupScheduling

    return GroupScheduling(config, log)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_finish(session: pytest.Session) -> None:
    """What collecting leaves stays to the end: looking through it for garbage again and again costs a tenth of all."""
    if hasattr(session.config, "workerinput"):
        from tests.groups import write_down

        write_down(session.items)
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    try:
        return (yield)
    finally:
        translation.deactivate()  # a test that reads Korean leaves the next one English
        browsing.after(item, nextitem)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    from core.streams import shared_pieces  # models, which are not loaded when pytest reads this file

    # a flushed database gives the same keys again, to other rows
    shared_pieces._parts._kept.clear()
    shared_pieces._newest = shared_pieces._Newest()
    kept.before(item)


def _turn(item: pytest.Item, marks: set[str]) -> int:
    group = item.get_closest_marker("xdist_group")
    if group is not None and group.args[0] in LONGEST:
        return 0
    if "browser" in marks:
        return 1
    return 3 if marks.isdisjoint(costs.SLOW) else 2


def _names_slow(file: Path) -> bool:
    return NAMES_SLOW.search(file.read_text()) is not None


def _scopes(item: pytest.Item) -> set[str]:
    """For how long what it asks for is kept."""
    known = item._fixtureinfo.name2fixturedefs if isinstance(item, pytest.Function) else {}
    return {definitions[-1].scope for definitions in known.values()}


@pytest.fixture(scope="session")
def migrated(request: pytest.FixtureRequest, django_db_use_migrations: bool) -> Path | None:
    """Where a migrated database is kept from run to run; None where none can be."""
    cache = getattr(request.config, "cache", None)
    if cache is None or connection.vendor != "sqlite" or not django_db_use_migrations:
        return None
    return database.template(cache.mkdir("migrated"))


@pytest.fixture(scope="session")
def migrating(migrated: Path | None) -> Iterator[Callable[[], None]]:
    """One process migrates, and the others wait for what it keeps: call it when that is there."""
    if migrated is None:
        yield lambda: None
        return
    with (migrated.parent / "lock").open("w") as lock:
        done = partial(fcntl.flock, lock, fcntl.LOCK_UN)
        fcntl.flock(lock, fcntl.LOCK_EX)
        if migrated.exists():
            done()
        yield done


@pytest.fixture(scope="session")
def django_db_keepdb(
    django_db_keepdb: bool, django_db_modify_db_settings: None, migrated: Path | None, migrating: Callable[[], None]
) -> bool:
    """pytest-django's; a database that was migrated before is put where it looks for one to keep."""
    if migrated is None or not migrated.exists():
        return django_db_keepdb
    database.copy(migrated, Path(connection.creation._get_test_db_name()))
    return True


@pytest.fixture(scope="session")
def django_db_setup(
    django_db_setup: None, migrated: Path | None, migrating: Callable[[], None], django_db_blocker
) -> Iterator[None]:
    """pytest-django's; what it has migrated is kept for the next time, and is what tests that commit leave."""
    made = Path(connection.settings_dict["NAME"])
    if migrated is not None and not migrated.exists() and made == Path(connection.creation._get_test_db_name()):
        database.keep(made, migrated)
    migrating()
    with django_db_blocker.unblock():
        back_to_migrated = emptied.emptied()
        back_to_migrated.__enter__()
    yield
    back_to_migrated.__exit__(None, None, None)


@pytest.fixture(scope="session")
def keep(request: pytest.FixtureRequest, django_db_setup: None, django_db_blocker) -> Iterator[Callable]:
    """For a fixture of the session: ``keep(request, make)`` has rows made once for tests that follow each other."""
    made = request.session.stash[kept.MADE] = {}

    def keep(request: pytest.FixtureRequest, make: Callable[[], object], fresh_s: float = inf) -> kept.Kept:
        assert request.fixturename not in made, "a name for each"
        one = made[request.fixturename] = kept.Kept(make, django_db_blocker.unblock, fresh_s)
        one.have()
        return one

    yield keep
    for one in made.values():
        one.drop()


@pytest.fixture(scope="session")
def new_data(django_db_setup: None, migrated: Path | None) -> Callable[..., Path]:
    """Make the data folder of a site that a test starts, with a migrated database in it where one is kept.

    ``house_cars``: so many of them race; an admin has sent the others home.
    """

    def make(folder: Path, house_cars: int | None = None) -> Path:
        folder.mkdir(parents=True)
        if migrated is not None and migrated.exists():
            database.copy(migrated, folder / "paddock.sqlite3")
            if house_cars is not None:
                for racer in _of_house_cars()[house_cars:]:
                    database.insert(folder / "paddock.sqlite3", racer)
        return folder

    return make


@pytest.fixture(scope="session", autouse=True)
def proven() -> None:
    """Workers within the tests' own process take it as proven that they compute as every other: most tests put
    something else in the place of what they would prove it by. Sites and workers that tests start prove it."""
    from tests.proven import take_as_proven

    take_as_proven()


@pytest.fixture(scope="session", autouse=True)
def frame_of_present_settings() -> None:
    """The frame of pages is drawn once a process, because settings do not change: those of tests do."""
    from django.test.signals import setting_changed

    from core.templatetags import site

    setting_changed.connect(lambda **_: site._drawn.cache_clear(), weak=False)


@pytest.fixture
def trainings_taken_on(settings, monkeypatch: pytest.MonkeyPatch) -> None:
    """Trainings can be asked for, whatever is installed here, and wait: no broker is told of them."""
    from tests.wakeups import heard

    settings.TRAINING, settings.TRAINING_PAUSED = True, False
    heard(monkeypatch, "training.tasks.train")


@pytest.fixture(scope="session")
def postgresql(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where PostgreSQL's data with a migrated test database are kept from run to run (tests/postgres.py)."""
    if not postgres.is_installed():
        pytest.skip("PostgreSQL is not installed")
    if connection.vendor == "postgresql":
        pytest.skip("this already is a run on PostgreSQL")
    cache = getattr(request.config, "cache", None)
    return Path(cache.mkdir("postgresql")) if cache else tmp_path_factory.mktemp("postgresql")


@pytest.fixture
def again_on_postgresql(postgresql: Path) -> Callable[..., None]:
    """Run tests (arguments of pytest) once more, on PostgreSQL: those whose subject is what the database does."""
    return partial(postgres.again, postgresql)


@pytest.fixture(scope="session")
def now() -> datetime:
    """A fixed moment, so that no test depends on the clock."""
    return datetime(2026, 11, 15, 12, 0, tzinfo=UTC)


@pytest.fixture(autouse=True)
def woken(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The readers of events that are woken, instead of a broker. A test that wants them to read calls ``follow``."""
    from core.events import waking

    names: list[str] = []
    monkeypatch.setattr(waking, "wake", names.append)
    return names


@pytest.fixture
def wakes(monkeypatch: pytest.MonkeyPatch) -> list[dict]:
    """Every wake-up of a worker that runs evaluations, instead of a broker."""
    from tests.wakeups import heard

    return heard(monkeypatch, "evaluation.tasks.work")


@pytest.fixture
def video_wakes(monkeypatch: pytest.MonkeyPatch) -> list[dict]:
    """Every wake-up of a worker that draws videos, instead of a broker; and videos of a few bytes, for tests that
    are not about what is drawn."""
    from tests.drawn_runs import a_drawing
    from tests.wakeups import heard
    from videos import drawing

    wakes = heard(monkeypatch, "videos.tasks.draw")
    monkeypatch.setattr(drawing, "write_video", a_drawing)
    monkeypatch.setattr(drawing, "poster", lambda scene: b"a still")
    return wakes


@pytest.fixture
def admitted_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Networks are converted and gated in this process, without a sandboxed one, where the wall is not tested."""
    from evaluation.garage import admission as admit
    from tests.hostile.here import launch_here

    monkeypatch.setattr(admit, "launch", launch_here)


@pytest.fixture
def alice(db: None):
    """A racer with an alias and nothing else. Bob and Charlie are two more."""
    return _racer("alice")


@pytest.fixture
def bob(db: None):
    return _racer("bob")


@pytest.fixture
def charlie(db: None):
    return _racer("charlie")


@pytest.fixture
def oval(db: None):
    """The catalogue's oval as a row."""
    from tests.rows import track_row

    return track_row("oval")


def _of_house_cars() -> list:
    from accounts.models import Racer
    from league.house_cars.services import house_cars

    return [
        Racer(alias=car.display_name, email=f"{car.name}@house.invalid", is_house=True, is_active=False)
        for car in house_cars()
    ]


def _racer(alias: str):
    from accounts.models import Racer

    return Racer.objects.create_user(alias, f"{alias}@example.org", "correct horse battery")


@pytest.fixture
def set_clock(monkeypatch: pytest.MonkeyPatch):
    """Make it this moment for every view."""
    return lambda moment: monkeypatch.setattr("django.utils.timezone.now", lambda: moment)
