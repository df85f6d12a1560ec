"""Uploads as ordinary tools write them are read; memory stays bounded."""

from __future__ import annotations

import hashlib
import io
import random
import tarfile
import tracemalloc
import zipfile
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paddock.errors import UserFault
from paddock.packages.limits import PackageLimits
from paddock.packages.read import RawPackage, UploadPart, read_upload
from tests.hostile.parts import (
    Upload,
    archive,
    good_network,
    gzip,
    metadata,
    regular,
    special,
    tar,
    tar_of,
    training_folder,
    zipped,
)
from tests.soak import examples

GRAPH = b"\x0a\x04abcd"
COACH = "worker_0.multi_agent_graph.main_level.main_level.agent_0.csv"


def read(files: Upload, limits: PackageLimits | None = None, checkpoint: str = "") -> RawPackage:
    parts = [UploadPart(name, io.BytesIO(content)) for name, content in files]
    return read_upload(parts, limits or PackageLimits(), checkpoint=checkpoint)


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


def test_folders_in_an_archive_do_not_matter() -> None:
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


def test_files_are_recognised_by_content_not_name() -> None:
    package = read([("model.pb", metadata()), ("model_metadata.json", good_network())])
    assert package.model == good_network()
    assert package.metadata_json == metadata()


def test_a_network_may_have_the_name_of_a_weights_file() -> None:
    assert read([("policy.bin", good_network()), ("m.json", metadata())]).model == good_network()


def test_the_digest_covers_the_file_as_sent() -> None:
    content = gzip(tar(("agent/model.pb", GRAPH), ("model_metadata.json", metadata())))
    assert read_one(content).source_sha256 == hashlib.sha256(content).hexdigest()


def test_the_order_of_two_files_does_not_change_the_digest() -> None:
    files = [("a", good_network()), ("b", metadata())]
    assert read(files).source_sha256 == read(files[::-1]).source_sha256


def test_an_archive_bomb_stays_within_the_memory_limits() -> None:
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


def test_an_endless_stream_is_cut_off_at_the_limit() -> None:
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


def test_a_stream_of_single_bytes_is_read() -> None:
    class Drip(io.BytesIO):
        def read(self, size: int = -1) -> bytes:
            return super().read(min(size, 1))

    content = gzip(tar(("agent/model.pb", GRAPH), ("model_metadata.json", metadata())))
    assert read_upload([UploadPart("x", Drip(content))]).model == GRAPH


CAR = gzip(tar(("agent/model.pb", GRAPH), ("model_metadata.json", metadata())))
ZIP = zipped(("car.onnx", GRAPH.replace(b"\x0a", b"\x08")), ("model_metadata.json", metadata()))
TAR = tar(("agent/model.pb", GRAPH), ("model_metadata.json", metadata()))


@settings(max_examples=examples(300), deadline=None)
@given(st.sampled_from([CAR, ZIP, TAR]), st.lists(st.tuples(st.integers(0, 1 << 16), st.integers(0, 255)), max_size=4))
def test_any_damage_gives_a_reason_or_does_no_harm(content: bytes, damage: list[tuple[int, int]]) -> None:
    broken = bytearray(content)
    for at, byte in damage:
        broken[at % len(broken)] = byte
    try:
        package = read_one(bytes(broken))
    except UserFault:
        return
    assert package.kind in ("tensorflow", "onnx")


@settings(max_examples=examples(100), deadline=None)
@given(st.sampled_from([CAR, ZIP, TAR]), st.integers(1, 600))
def test_a_truncated_file_is_refused(content: bytes, missing: int) -> None:
    kept = content.rstrip(b"\0")[: -min(missing, len(content.rstrip(b"\0")) - 1)]
    with pytest.raises(UserFault):
        read_one(kept)


def test_a_zip_with_zip64_local_headers_is_read() -> None:
    """As stable-baselines3 and every tool that streams writes them."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, content in (("car.onnx", good_network()), ("model_metadata.json", metadata())):
            with archive.open(name, "w", force_zip64=True) as member:
                member.write(content)
    assert read_one(buffer.getvalue()).model == good_network()


def test_a_streamed_zip_with_zip64_descriptors_is_read() -> None:
    class Pipe(io.BytesIO):
        def seekable(self) -> bool:
            return False

        def tell(self) -> int:
            raise OSError

    buffer = Pipe()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in (("car.onnx", good_network()), ("model_metadata.json", metadata())):
            with archive.open(name, "w", force_zip64=True) as member:
                member.write(content)
    assert read_one(buffer.getvalue()).model == good_network()


RECORD = b'{"best_checkpoint": {"name": "3_Step-9.ckpt", "avg_eval_metric": 99.0}, "last_checkpoint": {"name": "x"}}'
ITERATIONS = {12: b"\x0a\x04last", 3: b"\x0a\x04best", 7: b"\x0a\x04some"}


def zip_of(*members: tuple[str, bytes]) -> Upload:
    return [("training.zip", zipped(*members))]


@pytest.mark.parametrize("lead", ["", "./", "rl-deepracer-sagemaker/", "bucket/team 7/rl-deepracer-sagemaker/"])
@pytest.mark.parametrize("packed", [archive, zip_of])
@pytest.mark.parametrize(
    ("record", "asked", "taken", "reason"),
    [
        (RECORD, "", 3, "best"),
        (RECORD, "best", 3, "best"),
        (RECORD, "last", 12, "asked"),
        (RECORD, "7", 7, "asked"),
        (RECORD.replace(b"3_", b"99_"), "", 12, "last"),  # the best one was thrown away
        (None, "", 12, "last"),
        (b"nothing that can be read", "7", 7, "asked"),
    ],
)
def test_a_training_folder_gives_its_best_or_requested_checkpoint(
    lead: str, packed: Callable, record: bytes | None, asked: str, taken: int, reason: str
) -> None:
    files = training_folder(ITERATIONS, record, lead=lead, packed=packed)
    package = read(files, checkpoint=asked)
    lead = lead.removeprefix("./")
    assert (package.model, package.reason) == (ITERATIONS[taken], reason)
    assert package.taken == f"{lead}model/model_{taken}.pb"
    others = {f"{lead}model/model_{number}.pb" for number in ITERATIONS if number != taken}
    assert others < set(package.ignored)
    assert {f"{lead}notes.md", f"{lead}reward_function.py", f"{lead}checksum.txt"} < set(package.ignored)
    assert not {package.taken, f"{lead}model/model_metadata.json"} & set(package.ignored)


def test_the_metadata_nearest_to_the_network_counts() -> None:
    near, far = metadata(version="4"), metadata(version="5")
    files = training_folder(ITERATIONS, RECORD, near, more=(("model_metadata.json", far),))
    assert read(files).metadata_json == near


def test_metadata_in_a_trainings_custom_files_is_found() -> None:
    files = training_folder(
        ITERATIONS, RECORD, None, lead="team/", more=(("custom_files/model_metadata.json", metadata()),)
    )
    assert read(files).metadata_json == metadata()


def test_a_car_archive_beside_a_training_folder_is_taken() -> None:
    files = training_folder(ITERATIONS, RECORD, more=(("agent/model.pb", GRAPH),))
    assert read(files).model == GRAPH
    assert read(files, checkpoint="7").model == ITERATIONS[7]


def test_metadata_may_lie_beside_the_archive() -> None:
    packed = zipped(("car.onnx", good_network()))
    for files in ([("a.zip", packed), ("b", metadata())], [("b", metadata()), ("a.zip", packed)]):
        package = read(files)
        assert (package.model, package.metadata_json) == (good_network(), metadata())


def test_external_onnx_weights_are_read_from_archive_and_files() -> None:
    members = (("net/car.onnx", good_network()), ("net/car.onnx.data", b"PK\x03\x04"), ("other.data", b"x"))
    packed = read([("car.zip", zipped(*members, ("net/model_metadata.json", metadata())))])
    loose = read([("car.onnx.data", b"PK\x03\x04"), ("car.onnx", good_network()), ("m.json", metadata())])
    assert packed.weights == loose.weights == {"car.onnx.data": b"PK\x03\x04"}
    assert packed.ignored == ("other.data",)


def test_unneeded_files_are_ignored_and_listed() -> None:
    inner = zipped(("car.onnx", good_network()))
    more = (("inner.zip", inner), ("<img src=x>.txt", b"x"), ("logs/training.log", b"x"))
    package = read([("car.zip", zipped(("car.onnx", good_network()), ("model_metadata.json", metadata()), *more))])
    assert package.ignored == ("inner.zip", "<img src=x>.txt", "logs/training.log")


def test_a_large_folder_is_read_in_little_memory() -> None:
    graph = b"\x0a\x04" + random.Random(0).randbytes(4 << 20)
    files = training_folder({number: graph for number in range(8)}, RECORD, packed=archive)
    tracemalloc.start()
    try:
        assert read(files).taken == "model/model_3.pb"
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 3 * len(graph)
