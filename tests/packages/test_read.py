"""Uploads as ordinary tools write them are read; memory stays bounded."""

from __future__ import annotations

import hashlib
import io
import tarfile
import tracemalloc
import zipfile

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evaluation.packages.limits import PackageLimits
from evaluation.packages.read import RawPackage, UploadPart, read_upload
from faults import UserFault
from tests.hostile.parts import Upload, good_network, gzip, metadata, regular, special, tar, tar_of, zipped

GRAPH = b"\x0a\x04abcd"
COACH = "worker_0.multi_agent_graph.main_level.main_level.agent_0.csv"


def read(files: Upload, limits: PackageLimits | None = None) -> RawPackage:
    parts = [UploadPart(name, io.BytesIO(content)) for name, content in files]
    return read_upload(parts, limits or PackageLimits())


def read_one(content: bytes, **limits: int) -> RawPackage:
    return read([("upload", content)], PackageLimits(**limits))


@pytest.mark.parametrize("layout", [tarfile.PAX_FORMAT, tarfile.GNU_FORMAT, tarfile.USTAR_FORMAT])
@pytest.mark.parametrize("folder", ["", "./", "my-car/", "./a-car-with-a-name-so-long-that-it-needs-a-longer-header/"])
def test_a_cars_archive_is_read_in_every_layout(layout: int, folder: str) -> None:
    members = [
        regular(f"{folder}agent/model.pb", GRAPH),
        regular(f"{folder}model_metadata.json", metadata()),
        regular(f"{folder}{COACH}", b"1,2"),
        regular(f"{folder}worker_0.multi_agent_graph_0.json", b"{}"),
        regular(f"{folder}._model_metadata.json", b"apple"),
    ]
    for info, _ in members:
        info.mtime = 1_600_000_000.25  # not whole: Python then writes a pax header for every member
    package = read_one(gzip(tar_of(*members, format=layout)))
    assert package == RawPackage("tensorflow", GRAPH, metadata(), package.source_sha256)


def test_folders_in_an_archive_are_no_matter() -> None:
    folders = [special(name, tarfile.DIRTYPE) for name in ("./", "./agent/")]
    members = [*folders, regular("./agent/model.pb", GRAPH), regular("./model_metadata.json", metadata())]
    assert read_one(gzip(tar_of(*members))).model == GRAPH


def test_a_plain_tar_is_read_too() -> None:
    assert read_one(tar(("agent/model.pb", GRAPH), ("model_metadata.json", metadata()))).kind == "tensorflow"


def test_a_zip_from_a_mac_is_read() -> None:
    """Finder adds its own files, and streams its entries (sizes behind the data)."""

    class Unseekable(io.BytesIO):
        def seekable(self) -> bool:
            return False

        def seek(self, *_: object) -> int:
            raise OSError

    buffer = Unseekable()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("car/", b"")
        archive.writestr("car/car.onnx", good_network())
        archive.writestr("car/model_metadata.json", metadata())
        archive.writestr("__MACOSX/car/._car.onnx", b"apple")
        archive.writestr("car/.DS_Store", b"apple")
    assert read_one(buffer.getvalue()).model == good_network()


def test_a_zip_may_have_a_comment() -> None:
    content = bytearray(zipped(("car.onnx", good_network()), ("model_metadata.json", metadata())))
    content[-2:] = (5).to_bytes(2, "little")
    assert read_one(bytes(content) + b"hello").kind == "onnx"


def test_a_cars_files_may_come_in_a_zip() -> None:
    content = zipped(("agent/model.pb", GRAPH), ("model_metadata.json", metadata()))
    assert read_one(content).kind == "tensorflow"


def test_files_are_told_apart_by_content_and_not_by_name() -> None:
    package = read([("model.pb", metadata()), ("model_metadata.json", good_network())])
    assert package.model == good_network()
    assert package.metadata_json == metadata()


def test_the_digest_is_of_the_file_as_sent() -> None:
    content = gzip(tar(("agent/model.pb", GRAPH), ("model_metadata.json", metadata())))
    assert read_one(content).source_sha256 == hashlib.sha256(content).hexdigest()


def test_two_files_have_one_digest_in_either_order() -> None:
    files = [("a", good_network()), ("b", metadata())]
    assert read(files).source_sha256 == read(files[::-1]).source_sha256


def test_a_bomb_takes_no_more_memory_than_the_limits_allow() -> None:
    limits = PackageLimits(expanded_bytes=8 << 20, upload_bytes=4 << 20, model_bytes=8 << 20)
    bomb = gzip(tar(("agent/model.pb", bytes(8 << 20)), ("._padding", bytes(200 << 20))))
    tracemalloc.start()
    try:
        with pytest.raises(UserFault) as fault:
            read([("x", bomb)], limits)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert fault.value.code == "expanded_size"
    assert peak < 24 << 20


def test_an_endless_stream_is_cut_at_the_limit() -> None:
    class Endless:
        read_bytes = 0

        def read(self, size: int) -> bytes:
            self.read_bytes += size
            return b"\x08" * size

    stream = Endless()
    with pytest.raises(UserFault) as fault:
        read_upload([UploadPart("x", stream)], PackageLimits(upload_bytes=1 << 20))
    assert fault.value.code == "too_large"
    assert stream.read_bytes < 2 << 20


def test_a_stream_that_gives_a_byte_at_a_time_is_read() -> None:
    class Drip(io.BytesIO):
        def read(self, size: int = -1) -> bytes:
            return super().read(min(size, 1))

    content = gzip(tar(("agent/model.pb", GRAPH), ("model_metadata.json", metadata())))
    assert read_upload([UploadPart("x", Drip(content))]).model == GRAPH


CAR = gzip(tar(("agent/model.pb", GRAPH), ("model_metadata.json", metadata())))
ZIP = zipped(("car.onnx", GRAPH.replace(b"\x0a", b"\x08")), ("model_metadata.json", metadata()))
TAR = tar(("agent/model.pb", GRAPH), ("model_metadata.json", metadata()))


@settings(max_examples=300, deadline=None)
@given(st.sampled_from([CAR, ZIP, TAR]), st.lists(st.tuples(st.integers(0, 1 << 16), st.integers(0, 255)), max_size=4))
def test_damage_anywhere_ends_with_a_reason_or_does_no_harm(content: bytes, damage: list[tuple[int, int]]) -> None:
    broken = bytearray(content)
    for at, byte in damage:
        broken[at % len(broken)] = byte
    try:
        package = read_one(bytes(broken))
    except UserFault:
        return
    assert package.kind in ("tensorflow", "onnx")


@settings(max_examples=100, deadline=None)
@given(st.sampled_from([CAR, ZIP, TAR]), st.integers(1, 600))
def test_a_file_cut_anywhere_is_refused(content: bytes, missing: int) -> None:
    kept = content.rstrip(b"\0")[: -min(missing, len(content.rstrip(b"\0")) - 1)]
    with pytest.raises(UserFault):
        read_one(kept)
