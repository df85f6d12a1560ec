"""A racer's picture: what is taken, what is made of it, who sees it, and what takes it away."""

from __future__ import annotations

import struct
import zlib
from io import BytesIO

import pytest
from django.core.files.storage import default_storage
from django.core.files.uploadedfile import SimpleUploadedFile
from PIL import Image

from accounts.models import RacerQuota
from accounts.pictures.drawing import pattern
from accounts.pictures.reading import MOST_MB, SIDE, read_picture
from accounts.pictures.services import path_of, remove_picture, set_picture
from accounts.usage.storage import stored_by
from paddock.errors import UserFault

pytestmark = pytest.mark.django_db


def a_picture(kind: str = "PNG", size: tuple[int, int] = (300, 200), **more) -> BytesIO:
    out = BytesIO()
    Image.new("RGB", size, (10, 120, 60)).save(out, kind, **more)
    out.seek(0)
    return out


def a_bomb() -> BytesIO:
    """A PNG of a few bytes that says it is 60000 pixels wide and high."""
    head = struct.pack(">IIBBBBB", 60_000, 60_000, 8, 2, 0, 0, 0)

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    return BytesIO(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"0")))


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "WEBP"])
def test_a_picture_becomes_a_small_square_without_metadata(kind):
    exif = Image.Exif()
    exif[0x0112], exif[0x010E] = 6, "where I live"  # turned by its camera; a description
    made = Image.open(BytesIO(read_picture(a_picture(kind, exif=exif))))
    assert (made.format, made.size) == ("WEBP", (SIDE, SIDE))
    assert not made.getexif() and "exif" not in made.info and "icc_profile" not in made.info


def test_a_picture_is_turned_as_its_camera_said():
    exif = Image.Exif()
    exif[0x0112] = 3  # upside down
    two = Image.new("RGB", (64, 64), (255, 0, 0))
    two.paste((0, 0, 255), (0, 32, 64, 64))
    out = BytesIO()
    two.save(out, "PNG", exif=exif)
    out.seek(0)
    red, _green, blue = Image.open(BytesIO(read_picture(out))).convert("RGB").getpixel((SIDE // 2, 10))
    assert blue > 200 > 60 > red


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (BytesIO, "picture_format"),
        (lambda: BytesIO(b"<svg xmlns='http://www.w3.org/2000/svg'><script>alert(1)</script></svg>"), "picture_format"),
        (lambda: a_picture("GIF"), "picture_format"),
        (lambda: a_picture("BMP"), "picture_format"),
        (lambda: BytesIO(b"\x89PNG\r\n\x1a\n" + b"\0" * 50), "picture_format"),
        (lambda: BytesIO(a_picture("JPEG", (600, 600)).getvalue()[:1500]), "picture_broken"),
        (lambda: BytesIO(b"\0" * (MOST_MB * 2**20 + 1)), "picture_too_large"),
        (lambda: a_picture(size=(17_000, 10)), "picture_too_many_pixels"),
        (lambda: a_picture(size=(5001, 5000)), "picture_too_many_pixels"),
        (a_bomb, "picture_too_many_pixels"),
    ],
)
def test_what_is_no_picture_for_us_is_refused_and_changes_nothing(alice, now, content, code):
    with pytest.raises(UserFault) as refused:
        set_picture(racer=alice, file=content(), now=now)
    assert refused.value.code == code
    alice.refresh_from_db()
    assert alice.avatar is None and not stored_by(alice)


def test_a_picture_is_kept_weighed_replaced_and_removed(alice, now, django_capture_on_commit_callbacks):
    set_picture(racer=alice, file=a_picture(), now=now)
    first = alice.avatar
    (shelf,) = stored_by(alice)
    assert shelf.shelf.name == "pictures" and round(shelf.mb * 2**20) == alice.avatar_bytes > 0
    assert default_storage.size(path_of(first)) == alice.avatar_bytes
    with django_capture_on_commit_callbacks(execute=True):
        set_picture(racer=alice, file=a_picture("JPEG"), now=now)
    assert alice.avatar != first and not default_storage.exists(path_of(first))
    second = alice.avatar
    with django_capture_on_commit_callbacks(execute=True):
        assert remove_picture(racer=alice)
    assert not remove_picture(racer=alice)
    assert not default_storage.exists(path_of(second)) and not stored_by(alice)


def test_a_picture_goes_with_its_account(alice, now, django_capture_on_commit_callbacks):
    set_picture(racer=alice, file=a_picture(), now=now)
    name = alice.avatar
    with django_capture_on_commit_callbacks(execute=True):
        alice.delete()
    assert not default_storage.exists(path_of(name))


def test_a_picture_needs_room(alice, now):
    RacerQuota.objects.create(racer=alice, name="storage_mb", limit=0)
    with pytest.raises(UserFault) as refused:
        set_picture(racer=alice, file=a_picture(), now=now)
    assert refused.value.code == "storage_full"


def test_the_pages_show_and_change_it(alice, bob, client, now):
    assert "<svg class=" in client.get("/racers/alice/").content.decode()
    assert client.post("/settings/picture/", {"picture": ""}).status_code == 302  # to the log-in
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    sent = SimpleUploadedFile("me.png", a_picture().getvalue(), content_type="image/png")
    assert "Saved." in client.post("/settings/picture/", {"picture": sent}, follow=True).content.decode()
    alice.refresh_from_db()
    address = f"/avatars/{alice.avatar}.webp"
    assert address in client.get("/racers/alice/").content.decode()
    client.logout()
    answer = client.get(address)
    assert answer["Content-Type"] == "image/webp" and "immutable" in answer["Cache-Control"]
    assert b"".join(answer.streaming_content)[:4] == b"RIFF"
    client.force_login(bob, backend="django.contrib.auth.backends.ModelBackend")
    client.post("/settings/picture/remove/")  # his own, of which there is none
    alice.refresh_from_db()
    assert alice.avatar
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    assert "removed" in client.post("/settings/picture/remove/", follow=True).content.decode()
    assert client.get(address).status_code == 404
    bad = SimpleUploadedFile("me.svg", b"<svg/>", content_type="image/svg+xml")
    assert "PNG, JPEG or WebP" in client.post("/settings/picture/", {"picture": bad}, follow=True).content.decode()


def test_an_admin_removes_one(alice, admin_client, now):
    set_picture(racer=alice, file=a_picture(), now=now)
    sent = {"action": "remove_pictures", "_selected_action": [alice.pk]}
    page = admin_client.post("/admin/accounts/racer/", sent, follow=True)
    assert "1 picture was removed" in page.content.decode()
    alice.refresh_from_db()
    assert alice.avatar is None


def test_drawn_pictures_are_the_same_for_ever_and_differ_between_racers():
    assert pattern(7) == pattern(7)
    assert len({pattern(number) for number in range(1, 200)}) > 190
    assert all(pattern(number)[1] for number in range(1, 200))
