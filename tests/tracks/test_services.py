"""Importing tracks and loading the catalogue."""

from __future__ import annotations

import json
from datetime import datetime
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from django.core.management import CommandError, call_command

from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE, by_slug
from paddock.geometry.files import read_npy, write_npy
from paddock.geometry.track import TrackGeometry
from tests.factories import a_race
from tests.shared import SHARED, needs_shared
from tracks.models import Track
from tracks.services import delete_track, free_slug, import_track, load_catalogue

pytestmark = pytest.mark.django_db


@pytest.fixture
def oval_file() -> bytes:
    return write_npy(by_slug("oval").geometry())


def moved(data: bytes, by: float) -> bytes:
    """The same track somewhere else, which makes it another track."""
    track = read_npy(data, "moved")
    rows = np.hstack((track.centre, track.inner, track.outer)) + by
    return write_npy(TrackGeometry.from_arrays("moved", rows[:, 0:2], rows[:, 2:4], rows[:, 4:6]))


def refused(code: str, **kwargs) -> UserFault:
    with pytest.raises(UserFault) as caught:
        import_track(**kwargs)
    assert caught.value.code == code
    assert "?" not in str(caught.value)
    return caught.value


def test_an_imported_track_has_the_geometry_of_its_file(alice, now, oval_file):
    track = import_track(data=oval_file, name="  My\n oval ", owner=alice, now=now)
    track.refresh_from_db()
    geometry = by_slug("oval").geometry()
    assert (track.name, track.slug, track.owner, track.created_at) == ("My oval", "my-oval", alice, now)
    assert track.length_m == pytest.approx(geometry.length, abs=0.001)
    assert track.width_m == pytest.approx(1.07, abs=0.01)
    assert track.geometry.fingerprint == track.fingerprint == geometry.fingerprint
    assert not track.is_catalogue


def test_a_refused_file_leaves_nothing(alice, now):
    refused("track_not_npy", data=b"hello", name="Hello", owner=alice, now=now)
    assert not Track.objects.exists()


def test_a_racers_copy_of_a_known_track_is_refused(alice, bob, now, oval_file):
    import_track(data=oval_file, name="First", owner=alice, now=now)
    fault = refused("track_known", data=oval_file, name="Second", owner=bob, now=now)
    assert fault.params == {"name": "First", "slug": "first"}


def test_an_operators_copy_gives_the_known_track(now, oval_file):
    first = import_track(data=oval_file, name="First", owner=None, now=now)
    assert import_track(data=oval_file, name="Again", owner=None, now=now) == first
    assert Track.objects.count() == 1


def test_an_operator_gives_a_track_without_shape_its_shape(alice, now, oval_file):
    named = {"name": "Some_Speedway", "npy": b"", "direction": "ccw", "created_at": now}
    known = Track.objects.create(slug="some-speedway", fingerprint="unknown:1", **named)
    other = Track.objects.create(slug="another", fingerprint="unknown:2", **(named | {"name": "Another"}))
    race = a_race(now, track=known)
    theirs = import_track(data=moved(oval_file, 3), name="Some Speedway", owner=alice, now=now)
    assert theirs.pk != known.pk and not Track.objects.get(pk=known.pk).has_shape, (
        "racers' files are tracks of their own"
    )
    filled = import_track(data=oval_file, name="some speedway", owner=None, now=now)
    race.refresh_from_db()
    assert (filled.pk, filled.slug) == (known.pk, "some-speedway") and race.track.has_shape
    assert race.track.geometry.length == pytest.approx(by_slug("oval").geometry().length)
    assert import_track(data=moved(oval_file, 5), name="Anything", slug="another", owner=None, now=now) == other
    refused("track_slug", data=moved(oval_file, 7), name="Oval", owner=None, now=now, slug="another")


def test_two_tracks_of_one_name_get_different_addresses(alice, now, oval_file):
    slugs = [import_track(data=moved(oval_file, n), name="Ring", owner=alice, now=now).slug for n in range(3)]
    assert slugs == ["ring", "ring-2", "ring-3"]


@pytest.mark.parametrize(
    ("name", "slug"), [("한국 서킷", "track"), ("Import", "import-2"), ("New", "new-2"), ("To choose", "to-choose-2")]
)
def test_non_latin_and_reserved_names_get_an_address_too(db, name, slug):
    assert free_slug(name) == slug


@pytest.mark.parametrize("name", ["", "   ", "x" * 65])
def test_a_track_needs_a_name_that_fits(alice, now, oval_file, name):
    refused("track_name", data=oval_file, name=name, owner=alice, now=now)


@pytest.mark.parametrize("slug", ["", "Oval", "a b", "-a", "import", "../x", "x" * 65, "taken"])
def test_an_unusable_address_is_refused(now, oval_file, slug):
    import_track(data=moved(oval_file, 1), name="Taken", owner=None, now=now)
    refused("track_slug", data=oval_file, name="Oval", owner=None, now=now, slug=slug)


def test_the_limit_of_imports_binds_racers_but_not_admins(alice, bob, now, oval_file, settings):
    settings.TRACKS_PER_RACER = 1
    import_track(data=oval_file, name="One", owner=alice, now=now)
    refused("track_limit", data=moved(oval_file, 1), name="Two", owner=alice, now=now)
    bob.is_staff = True
    bob.save()
    for number in (2, 3):
        import_track(data=moved(oval_file, number), name="Many", owner=bob, now=now)


def test_loading_the_catalogue_again_changes_nothing(now):
    rows = load_catalogue(now=now)
    assert [row.slug for row in rows] == [entry.slug for entry in CATALOGUE]
    for row, entry in zip(rows, CATALOGUE, strict=True):
        row.refresh_from_db()
        assert row.is_catalogue
        assert row.geometry.fingerprint == entry.geometry().fingerprint
    before = list(Track.objects.order_by("pk").values())
    assert load_catalogue(now=datetime(2030, 1, 1, tzinfo=now.tzinfo)) == rows
    assert list(Track.objects.order_by("pk").values()) == before


def test_a_known_catalogue_is_read_at_once_and_its_changes_are_noticed(now, django_assert_max_num_queries):
    load_catalogue(now=now)
    with django_assert_max_num_queries(5):
        load_catalogue(now=now)
    oval = Track.objects.filter(slug="oval")
    oval.update(name="Something else")
    load_catalogue(now=now)
    assert oval.get().name == by_slug("oval").name


def test_a_new_catalogue_shape_takes_over_the_address(now, oval_file):
    old = import_track(data=moved(oval_file, 1), name="Old oval", owner=None, now=now, slug="oval")
    Track.objects.update(is_catalogue=True)
    load_catalogue(now=now)
    old.refresh_from_db()
    assert old.slug.startswith("oval-") and not old.is_catalogue
    assert Track.objects.get(slug="oval").fingerprint == by_slug("oval").geometry().fingerprint


def test_the_catalogue_takes_over_a_racers_imported_track(alice, now, oval_file):
    mine = import_track(data=oval_file, name="Mine", owner=alice, now=now)
    load_catalogue(now=now)
    mine.refresh_from_db()
    assert (mine.slug, mine.is_catalogue, mine.owner) == ("oval", True, None)


def test_a_track_with_races_cannot_be_deleted(alice, now, oval_file):
    track = import_track(data=oval_file, name="Ring", owner=alice, now=now)
    race = a_race(now, track=track)
    with pytest.raises(UserFault) as caught:
        delete_track(track=track)
    assert caught.value.code == "track_in_use"
    race.delete()
    delete_track(track=track)
    assert not Track.objects.exists()


def test_the_command_imports_a_file_and_prints_it(tmp_path: Path, oval_file):
    file = tmp_path / "my_oval.npy"
    file.write_bytes(oval_file)
    out = StringIO()
    call_command("import_track", file, "--json", stdout=out)
    printed = json.loads(out.getvalue())
    assert (printed["slug"], printed["name"]) == ("my-oval", "my oval")
    assert printed["length_m"] == pytest.approx(18.0, rel=0.005)
    out = StringIO()
    call_command("import_track", file, "--name", "Other", stdout=out)
    assert out.getvalue().startswith("my-oval: my oval, 18.0")


def test_the_command_exits_with_2_on_a_refused_file(tmp_path: Path):
    file = tmp_path / "bad.npy"
    file.write_bytes(b"\x80\x04N.")
    with pytest.raises(CommandError, match=r"^track_pickled: ") as caught:
        call_command("import_track", file)
    assert caught.value.returncode == 2


def test_the_command_names_an_unreadable_file(tmp_path: Path):
    with pytest.raises(CommandError, match=r"none\.npy cannot be read"):
        call_command("import_track", tmp_path / "none.npy")


@needs_shared
def test_every_community_track_imports_as_what_it_is(now):
    refusals = {}
    for path in sorted((SHARED / "tracks").glob("*.npy")):
        for is_open in (False, True):
            try:
                import_track(data=path.read_bytes(), name=path.stem, owner=None, now=now, is_open=is_open)
            except UserFault as fault:
                refusals.setdefault(fault.code, set()).add(path.stem)
    assert refusals["track_open"] == {"Straight_track"}
    assert set(refusals) == {"track_open", "track_not_open"}
    assert Track.objects.count() >= 20
    assert [track.name for track in Track.objects.filter(is_open=True)] == ["Straight_track"]


def test_an_open_track_keeps_its_shape_and_its_words(now, alice):
    data = by_slug("straight-track").npy
    track = import_track(data=data, name="Sprint", owner=alice, now=now, is_open=True)
    track = Track.objects.get(pk=track.pk)
    assert track.geometry.is_open and bytes(track.npy) == data
    assert [track.way(direction) for direction in ("ccw", "cw")] == ["from start to end", "from end to start"]


def test_a_loop_is_not_imported_as_open(now, alice, oval_file):
    fault = refused("track_not_open", data=oval_file, name="Round", owner=alice, now=now, is_open=True)
    assert "is a loop" in str(fault)
    assert not Track.objects.exists()


def test_a_track_keeps_the_look_it_was_imported_with(oval_file, alice, now):
    assert import_track(data=oval_file, name="Plain", owner=alice, now=now).look == "official"
    assert import_track(data=moved(oval_file, 1), name="Bold", owner=alice, now=now, look="bold").look == "bold"


def test_an_unknown_look_is_refused_with_the_known_ones(oval_file, alice, now):
    fault = refused("track_look", data=oval_file, name="Odd", owner=alice, now=now, look="neon")
    assert "official, textures, bold" in str(fault)
    assert not Track.objects.exists()
