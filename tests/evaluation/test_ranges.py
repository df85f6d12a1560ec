"""Stored files in pieces, as players ask for them (RFC 9110, sections 13 and 14)."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from types import SimpleNamespace

import pytest
from django.core.files.storage import FileSystemStorage
from django.test import RequestFactory

from core.files.range_responses import PIECE, stored_file_response

CONTENT = bytes(range(256)) * 4  # 1024 bytes
ETAG = '"abc"'


@pytest.fixture
def video(tmp_path: Path) -> SimpleNamespace:
    """What a FileField gives: a name and its storage."""
    (tmp_path / "video.mp4").write_bytes(CONTENT)
    return SimpleNamespace(name="video.mp4", storage=FileSystemStorage(tmp_path))


def ask(video, method: str = "get", size: int = len(CONTENT), most: int | None = None, **headers: str):
    request = getattr(RequestFactory(), method)("/", headers={k.replace("_", "-"): v for k, v in headers.items()})
    return stored_file_response(request, video, size=size, digest="abc", content_type="video/mp4", most=most)


def body(response) -> bytes:
    return b"".join(response.streaming_content) if response.streaming else response.content


def test_without_a_range_the_whole_file_is_sent(video):
    response = ask(video)
    assert response.status_code == 200
    assert body(response) == CONTENT
    assert (response["Content-Length"], response["Accept-Ranges"], response["ETag"]) == ("1024", "bytes", ETAG)
    assert response["Content-Type"] == "video/mp4"
    assert not response.has_header("Content-Range")


@pytest.mark.parametrize(
    ("asked", "start", "stop"),
    [
        ("bytes=0-1", 0, 2),  # what Safari asks first
        ("bytes=0-", 0, 1024),  # what Chromium asks first
        ("bytes=100-199", 100, 200),
        ("bytes=1000-9999", 1000, 1024),
        ("bytes=1023-", 1023, 1024),
        ("bytes=-24", 1000, 1024),
        ("bytes=-99999", 0, 1024),
        ("bytes= 5 - 6", 5, 7),
    ],
)
def test_a_range_gives_a_part(video, asked, start, stop):
    response = ask(video, range=asked)
    assert response.status_code == 206
    assert response["Content-Range"] == f"bytes {start}-{stop - 1}/1024"
    assert response["Content-Length"] == str(stop - start)
    assert body(response) == CONTENT[start:stop]


def test_an_open_range_is_served_piece_by_piece(video):
    starts, received = [0], b""
    while starts[-1] < len(CONTENT):
        response = ask(video, range=f"bytes={starts[-1]}-", most=300)
        received += body(response)
        starts.append(len(received))
    assert starts == [0, 300, 600, 900, 1024]
    assert received == CONTENT
    assert len(body(ask(video, range="bytes=0-999", most=300))) == 1000
    assert len(body(ask(video, most=300))) == 1024


@pytest.mark.parametrize("asked", ["bytes=1024-", "bytes=5000-6000", "bytes=-0"])
def test_a_range_beyond_the_end_is_refused_with_the_size(video, asked):
    response = ask(video, range=asked)
    assert response.status_code == 416
    assert response["Content-Range"] == "bytes */1024"
    assert body(response) == b""


@pytest.mark.parametrize(
    "asked", ["bytes=0-1,4-5", "bytes=9-3", "bytes=-", "bytes=a-b", "lines=0-1", "bytes=" + "9" * 500 + "-", "bytes=²-"]
)
def test_anything_but_a_single_range_gets_the_whole_file(video, asked):
    response = ask(video, range=asked)
    assert response.status_code == 200
    assert body(response) == CONTENT


def test_if_range_gives_a_part_of_the_same_file_only(video):
    assert ask(video, range="bytes=0-9", if_range=ETAG).status_code == 206
    for other in ('"another"', 'W/"abc"', "Sun, 22 Nov 2026 08:49:37 GMT"):
        assert ask(video, range="bytes=0-9", if_range=other).status_code == 200


def test_etags_decide_between_304_412_and_the_file(video):
    assert ask(video, if_none_match=ETAG).status_code == 304
    assert ask(video, if_none_match=ETAG, range="bytes=0-9").status_code == 304
    assert ask(video, if_none_match='"another"').status_code == 200
    assert ask(video, if_match='"another"', range="bytes=0-9").status_code == 412


def test_head_gives_the_size_and_no_body(video):
    response = ask(video, method="head", range="bytes=0-9")
    assert (response.status_code, response["Content-Length"], response["Accept-Ranges"]) == (200, "1024", "bytes")
    assert body(response) == b""


@pytest.mark.parametrize("method", ["get", "head"])
def test_a_missing_file_is_noticed_before_the_response_starts(video, method):
    video.storage.delete(video.name)
    with pytest.raises(FileNotFoundError):
        ask(video, method=method)


def test_a_long_video_is_never_held_in_memory(video, tmp_path):
    size = 64 << 20
    with (tmp_path / "video.mp4").open("wb") as file:
        file.truncate(size)
    response = ask(video, size=size)
    tracemalloc.start()
    sent = sum(len(piece) for piece in response.streaming_content)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert sent == size
    assert peak < 8 * PIECE


def test_only_the_requested_part_is_fetched_from_a_bucket(video):
    """django-storages would fetch a file whole before its first byte is read."""
    fetched, closed = [], []

    class Body:
        def __init__(self, span: str) -> None:
            first, last = map(int, span.removeprefix("bytes=").split("-"))
            self.content = CONTENT[first : last + 1]

        def iter_chunks(self, size: int):
            yield self.content

        def close(self) -> None:
            closed.append(True)

    class Remote:
        def get(self, Range: str):
            fetched.append(Range)
            return {"Body": Body(Range)}

    class Bucket:
        def open(self, name: str, mode: str):
            def read(*_args):
                raise AssertionError("all of it would be fetched")

            return SimpleNamespace(obj=Remote(), close=lambda: None, read=read, seek=read)

    response = ask(SimpleNamespace(name="video.mp4", storage=Bucket()), range="bytes=10-19")
    assert body(response) == CONTENT[10:20]
    assert (fetched, closed) == (["bytes=10-19"], [True])
