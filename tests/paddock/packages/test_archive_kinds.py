"""Archives as people pack them: other compressions, other separators, archives in archives, copies, names in any
script. What is unambiguous is read; everything else is named."""

from __future__ import annotations

import bz2
import io
import json
import lzma
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable

import pytest

from paddock.errors import UserFault
from paddock.packages.compressed import CHUNK
from paddock.packages.limits import PackageLimits
from paddock.packages.metadata import parse_metadata
from paddock.packages.read import RawPackage, UploadPart, read_upload
from tests.hostile.parts import archive, gzip, metadata, tar, training_folder, zipped
from tests.shared import SHARED

from .test_read import GRAPH, ITERATIONS, read

META = ("model_metadata.json", metadata())
TAR = tar(("agent/model.pb", GRAPH), META)
Pack = Callable[[bytes], bytes]


def members_of(content: bytes, size: int) -> bytes:
    """gzip of several members, as bgzip and pigz write it."""
    return b"".join(gzip(content[at : at + size]) for at in range(0, len(content), size))


def taken(content: bytes, name: str = "upload") -> RawPackage:
    return read([(name, content)])


COMPRESSED: dict[str, Pack] = {
    "xz": lzma.compress,
    "xz, two streams": lambda content: lzma.compress(content[:700]) + lzma.compress(content[700:]),
    "xz, padded": lambda content: lzma.compress(content) + bytes(8),
    "bzip2": bz2.compress,
    "bzip2, three streams": lambda content: (
        b"".join(bz2.compress(content[at : at + 700]) for at in (0, 700)) + bz2.compress(content[1400:])
    ),
    "gzip, two members": lambda content: members_of(content, 3000),
    "gzip, many members": lambda content: members_of(content, 100),
    "gzip, an empty member at the end": lambda content: gzip(content) + gzip(b""),
    "gzip, padded between": lambda content: gzip(content[:3000]) + bytes(512) + gzip(content[3000:]),
    "gzip twice": lambda content: gzip(gzip(content)),
    "gzip around xz": lambda content: gzip(lzma.compress(content)),
}


@pytest.mark.parametrize("kind", COMPRESSED)
@pytest.mark.parametrize("piece", [CHUNK, 1], ids=["at once", "byte by byte"])
def test_a_tar_is_read_in_any_compression(kind: str, piece: int) -> None:
    class Slow(io.BytesIO):
        def read(self, size: int | None = -1, /) -> bytes:
            return super().read(piece if size is None or size < 0 else min(size, piece))

    package = read_upload([UploadPart("x", Slow(COMPRESSED[kind](TAR)))])
    assert (package.model, package.metadata_json) == (GRAPH, metadata())


@pytest.mark.parametrize("kind", COMPRESSED)
def test_a_training_in_any_compression_is_read_twice(kind: str) -> None:
    """The last of its networks is fetched by a second pass."""
    ((_, packed),) = training_folder({number: bytes([10, 4]) + bytes(3000) for number in (1, 2, 3)}, None)
    plain = zlib.decompress(packed, 31)
    assert taken(COMPRESSED[kind](plain)).taken == "model/model_3.pb"


INNER = {
    "zip around tar.gz": zipped(("model.tar.gz", gzip(TAR))),
    "zip around tar.xz in a folder": zipped(("cars/", b""), ("cars/Model.TAR.XZ", lzma.compress(TAR))),
    "zip around zip": zipped(("model.zip", zipped(("agent/model.pb", GRAPH), META))),
    "zip around zip around tar.gz": zipped(("a.zip", zipped(("b.tar.gz", gzip(TAR))))),
    "zip around tar.gz and notes": zipped(("notes.txt", b"fast"), ("model.tar.gz", gzip(TAR)), ("._x", b"apple")),
    "tar.gz around tar.gz": gzip(tar(("model.tar.gz", gzip(TAR)))),
    "tar around zip": tar(("model.zip", zipped(("agent/model.pb", GRAPH), META))),
    "gzip around zip": gzip(zipped(("agent/model.pb", GRAPH), META)),
    "metadata beside the inner archive": zipped(("model.tar.gz", gzip(tar(("agent/model.pb", GRAPH)))), META),
}


@pytest.mark.parametrize("kind", INNER)
def test_an_archive_around_one_archive_is_read(kind: str) -> None:
    package = taken(INNER[kind])
    assert (package.model, package.metadata_json) == (GRAPH, metadata())
    assert not {META[0], "agent/model.pb"} & set(package.ignored)


def test_metadata_may_be_sent_beside_nested_archives() -> None:
    outer = zipped(("model.tar.gz", gzip(tar(("agent/model.pb", GRAPH)))))
    assert read([("car.zip", outer), META]).metadata_json == metadata()


def test_archives_nested_too_deeply_are_refused() -> None:
    content = gzip(TAR)
    for _ in range(4):
        content = zipped(("car.zip", content))
    with pytest.raises(UserFault) as fault:
        taken(content)
    assert fault.value.code == "model_missing"
    assert fault.value.params["found"] == "car.zip"


def test_a_bomb_in_layers_stays_within_the_memory_limits() -> None:
    limits = PackageLimits(expanded_bytes=8 << 20, upload_bytes=4 << 20, model_bytes=4 << 20)
    bomb = tar(("agent/model.pb", bytes(2 << 20)), ("._padding", bytes(64 << 20)))
    once = gzip(bomb)
    packed = [lzma.compress(bomb, preset=1), bz2.compress(bomb), gzip(once), zipped(("model.tar.gz", once))]
    for content in packed:
        tracemalloc.start()
        try:
            with pytest.raises(UserFault) as fault:
                read([("x", content)], limits)
            _, peak = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert fault.value.code == "expanded_size"
        assert peak < 24 << 20


@pytest.mark.parametrize("pack", [gzip, lzma.compress, bz2.compress])
def test_a_compressed_network_beside_its_metadata_is_read(pack: Pack) -> None:
    for graph in (GRAPH + bytes(2000), b"\x08" + GRAPH[1:] + bytes(2000)):
        assert read([("model.gz", pack(graph)), META]).model == graph


def test_a_tar_of_unix_v7_is_read() -> None:
    old = bytearray()
    for name, content in (("agent/", b""), ("agent/model.pb", GRAPH), META):
        header = bytearray(512)
        header[: len(name)] = name.encode()
        header[100:148] = b"0000644\0" + b"0000000\0" * 2 + f"{len(content):011o}\0".encode() + b"00000000000\0"
        header[148:156] = b" " * 8
        header[148:156] = f"{sum(header):06o}\0 ".encode()
        old += header + content + bytes(-len(content) % 512)
    assert taken(gzip(bytes(old) + bytes(1024))).model == GRAPH


# --- names


def zip_of_names(*members: tuple[bytes, bytes]) -> bytes:
    """A zip whose names are these bytes, whatever they mean."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as made:
        for number, (name, content) in enumerate(members):
            made.writestr(zipfile.ZipInfo(chr(ord("A") + number) * len(name)), content)
    packed = buffer.getvalue()
    for number, (name, _) in enumerate(members):  # in its own header and in the directory
        packed = packed.replace(bytes([ord("A") + number]) * len(name), name)
    return packed


NAMES = {
    "backslashes": (b"agent\\model.pb", b"model_metadata.json"),
    "backslashes, deeper": (b"my car\\agent\\model.pb", b"my car\\model_metadata.json"),
    "a training's backslashes": (b"t\\model\\model_3.pb", b"t\\model\\model_metadata.json"),
    "upper case": (b"AGENT/MODEL.PB", b"MODEL_METADATA.JSON"),
    "mixed case": (b"Agent/Model.pb", b"Model_Metadata.json"),
    "a case of its own for ONNX": (b"Car.Onnx", b"Model_metadata.JSON"),
    "a browser's copy": (b"agent/model.pb", b"model_metadata (1).json"),
    "a browser's copies": (b"model (2).pb", b"model_metadata(2).json"),
    "a file manager's copy": (b"model - Copy.pb", b"model_metadata copy 2.json"),
    "Japanese": ("レーサー/agent/model.pb".encode(), "レーサー/model_metadata.json".encode()),
    "Korean": ("내 차/agent/model.pb".encode(), "내 차/model_metadata.json".encode()),
    "a wide space": ("車\u3000一/model.pb".encode(), b"model_metadata.json"),
    "Korean as Windows writes it": ("차/agent/model.pb".encode("cp949"), "차/model_metadata.json".encode("cp949")),
    "Japanese as Windows writes it": ("表/model.pb".encode("cp932"), b"model_metadata.json"),
    "emoji": ("🏎️/agent/model.pb".encode(), "🏎️/model_metadata.json".encode()),
}


@pytest.mark.parametrize("kind", NAMES)
def test_names_of_every_kind_are_read_from_a_zip(kind: str) -> None:
    network, meta = NAMES[kind]
    content = GRAPH if not network.lower().endswith(b"onnx") else b"\x08" + GRAPH[1:]
    package = taken(zip_of_names((network, content), (meta, metadata())))
    assert (package.model, package.metadata_json) == (content, metadata())
    assert "?" not in package.taken


@pytest.mark.parametrize("kind", [kind for kind in NAMES if "Windows" not in kind])
def test_names_of_every_kind_are_read_from_a_tar(kind: str) -> None:
    network, meta = (name.decode() for name in NAMES[kind])
    content = GRAPH if not network.lower().endswith("onnx") else b"\x08" + GRAPH[1:]
    package = taken(gzip(tar((network, content), (meta, metadata()))))
    assert (package.model, package.metadata_json) == (content, metadata())


def test_a_folder_entry_of_powershell_is_a_folder() -> None:
    content = zip_of_names((b"agent\\", b""), (b"agent\\model.pb", GRAPH), (b"model_metadata.json", metadata()))
    assert taken(content).model == GRAPH


def test_messages_show_names_in_any_script() -> None:
    with pytest.raises(UserFault) as fault:
        taken(gzip(tar(("레이서/메모.txt", b"x"), META)))
    assert fault.value.code == "model_missing"
    assert "레이서/메모.txt" in str(fault.value) and "model_metadata.json" in str(fault.value)
    with pytest.raises(UserFault) as fault:
        taken(gzip(tar(("차.onnx", b"\x08\x01"))))
    assert fault.value.code == "metadata_missing"
    assert "차.onnx" in str(fault.value)


# --- copies


def test_equal_copies_of_a_network_count_once() -> None:
    files = [("agent/model.pb", GRAPH), ("model.pb", GRAPH), ("backup/model.pb", GRAPH), META]
    for content in (gzip(tar(*files)), zipped(*files)):
        assert taken(content).model == GRAPH
        assert taken(content).taken == "agent/model.pb"
    files[2] = ("backup/model.pb", GRAPH[::-1])
    with pytest.raises(UserFault) as fault:
        taken(zipped(*files))
    assert fault.value.code == "several_networks"


def test_an_iterations_equal_copies_count_once() -> None:
    files = [("model/model_3.pb", GRAPH), ("model/model_3 (1).pb", GRAPH), ("model/model_1.pb", b"\x0a\x04old!"), META]
    assert taken(zipped(*files)).taken == "model/model_3.pb"
    files[1] = ("model/model_3 (1).pb", GRAPH + b"1")
    with pytest.raises(UserFault) as fault:
        taken(zipped(*files))
    assert fault.value.code == "several_networks"


def test_equal_copies_of_the_metadata_count_once() -> None:
    files = [("a/model.pb", GRAPH), ("b/model_metadata.json", metadata()), ("c/model_metadata.json", metadata())]
    assert taken(gzip(tar(*files))).metadata_json == metadata()


def test_the_metadata_of_the_plain_name_goes_before_a_copy() -> None:
    files = [("model.pb", GRAPH), ("model_metadata (1).json", metadata(version="3")), META]
    assert taken(zipped(*files)).metadata_json == metadata()


def test_two_copies_of_different_metadata_are_refused() -> None:
    files = [("model.pb", GRAPH), *((f"model_metadata ({n}).json", metadata(version=n)) for n in (1, 2))]
    with pytest.raises(UserFault) as fault:
        taken(zipped(*files))
    assert fault.value.code == "duplicate_member"


def test_the_same_path_twice_counts_once_where_both_are_equal() -> None:
    """As ``tar --append`` and some zip tools write a file that was added twice."""
    files = [("agent/model.pb", GRAPH), META, ("agent/model.pb", GRAPH), META]
    assert taken(gzip(tar(*files))).model == GRAPH
    with pytest.warns(UserWarning, match="Duplicate name"):
        twice = zipped(*files)
    assert taken(twice).model == GRAPH


# --- a training's record


@pytest.mark.parametrize(
    "record",
    [
        {"best_checkpoint": {"name": "", "time_stamp": "", "avg_comp_pct": -1.0}, "last_checkpoint": {"name": "x"}},
        {"best_checkpoint": {"name": None}},
        {"best_checkpoint": {}},
        {"best_checkpoint": None},
        {"best_checkpoint": ""},
        {"last_checkpoint": {"name": "12_Step-9.ckpt"}},
        {},
    ],
    ids=lambda record: json.dumps(record)[:40],
)
def test_a_record_without_a_best_checkpoint_gives_the_last(record: dict) -> None:
    files = training_folder(ITERATIONS, json.dumps(record).encode(), packed=archive)
    package = read(files)
    assert (package.model, package.reason) == (ITERATIONS[12], "last")
    with pytest.raises(UserFault) as fault:
        read(files, checkpoint="best")
    assert fault.value.code == "checkpoint_missing"


# --- inputs that were refused once

FAILING = SHARED / "failing"


@pytest.mark.skipif(not FAILING.is_dir(), reason="the shared material is not here")
@pytest.mark.parametrize(
    "name",
    ["01-zip-backslash.zip", "02-checkpoints-no-best.tar.gz", "03-multi-member-gzip.tar.gz", "05-model.tar.xz",
     "06-mixed-case.tar.gz", "09-unicode-folder.tar.gz"],
)  # fmt: skip
def test_an_archive_that_was_refused_is_read(name: str) -> None:
    package = taken((FAILING / name).read_bytes())
    assert package.kind == "tensorflow"
    assert parse_metadata(package.metadata_json).actions


@pytest.mark.skipif(not FAILING.is_dir(), reason="the shared material is not here")
def test_an_openvino_export_is_named_as_one() -> None:
    with pytest.raises(UserFault) as fault:
        taken((FAILING / "08-own-openvino-export.tar.gz").read_bytes())
    assert (fault.value.code, fault.value.params["format"]) == ("network_format", "OpenVINO")
