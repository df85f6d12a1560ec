"""A folder in place of a model: what counts as one model, what as many, and what is left alone."""

from __future__ import annotations

import shutil
import tarfile
from pathlib import Path

import pytest

from paddock.cli import folders
from paddock.cli.folders import models_in
from paddock.errors import UserFault
from tests.shared import CHECKOUT, CONSOLE_CAR, needs_shared
from training.golden.cars import HOUSE_CARS


def put(car: str, network: Path, metadata: Path) -> None:
    for source, target in ((f"{car}.onnx", network), (f"{car}.json", metadata)):
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(HOUSE_CARS / source, target)


@pytest.fixture
def garage(tmp_path) -> Path:
    """An unpacked model, one in a file of its own, one with its metadata beside it, and files that are no models."""
    folder = tmp_path / "garage"
    put("flyer", folder / "unpacked/agent/car.onnx", folder / "unpacked/model_metadata.json")
    put("brisk", folder / "brisk.onnx", folder / "brisk.json")
    (folder / "packed").mkdir()
    with tarfile.open(folder / "packed/model.tar.gz", "w:gz") as tar:
        tar.add(HOUSE_CARS / "flyer.onnx", "model.onnx")
        tar.add(HOUSE_CARS / "flyer.json", "model_metadata.json")
    (folder / "notes.txt").write_text("mine")
    return folder


def names(folder: Path) -> list[str]:
    return [model.name for model in models_in(folder)[0]]


def test_every_model_of_a_folder_is_found_with_its_name(garage):
    assert names(garage) == ["brisk", "packed", "unpacked"]
    assert names(garage / "unpacked") == ["unpacked"]


def test_networks_that_share_their_metadata_are_models_of_their_own(tmp_path):
    put("flyer", tmp_path / "a.onnx", tmp_path / "model_metadata.json")
    put("flyer", tmp_path / "b.onnx", tmp_path / "model_metadata.json")
    found, _ = models_in(tmp_path)
    assert [[file.name for file in model.files] for model in found] == [
        ["a.onnx", "model_metadata.json"],
        ["b.onnx", "model_metadata.json"],
    ]


def test_links_are_not_followed(paddock, garage, tmp_path):
    outside = tmp_path / "outside"
    put("flyer", outside / "secret.onnx", outside / "secret.json")
    (garage / "linked").symlink_to(outside)
    (garage / "linked.onnx").symlink_to(outside / "secret.onnx")
    (garage / "unpacked/more.json").symlink_to(outside / "secret.json")
    found, links = models_in(garage)
    assert links == 3
    assert not [file for model in found for file in model.files if "secret" in str(file.resolve())]


def test_a_loop_of_links_ends(tmp_path):
    (tmp_path / "again").symlink_to(tmp_path)
    with pytest.raises(UserFault, match="contains no model"):
        models_in(tmp_path)


@pytest.mark.parametrize(("bound", "value"), [("MOST_ENTRIES", 5), ("MOST_DEPTH", 0), ("MOST_MODELS", 2)])
def test_reading_a_folder_is_bounded(paddock, garage, monkeypatch, bound, value):
    monkeypatch.setattr(folders, bound, value)
    said = paddock("export", garage)
    assert (said.status, said.code) == (2, "home_folder_large")


def test_an_unpacked_model_has_the_size_of_an_upload_at_most(paddock, garage, monkeypatch, tmp_path):
    monkeypatch.setattr(folders, "DEFAULT_LIMITS", folders.DEFAULT_LIMITS.__class__(upload_bytes=1000))
    assert paddock("export", garage / "unpacked", "--to", tmp_path / "car.tar.gz").code == "home_folder_large"


def test_an_unpacked_model_is_exported_like_its_archive(paddock, garage, tmp_path):
    assert paddock("export", garage / "unpacked", "--to", tmp_path / "one.tar.gz").status == 0
    assert paddock("export", garage / "packed/model.tar.gz", "--to", tmp_path / "two.tar.gz").status == 0
    assert (tmp_path / "one.tar.gz").read_bytes() == (tmp_path / "two.tar.gz").read_bytes()


def test_all_models_of_a_folder_are_exported_and_failures_are_counted(paddock, garage, tmp_path):
    (garage / "broken.zip").write_bytes(b"no zip")
    (tmp_path / "out").mkdir()
    said = paddock("export", garage, "--to", tmp_path / "out", "--json")
    assert said.status == 1
    assert (said.json["done"], said.json["failed"]) == (3, 1)
    broken = next(row for row in said.json["models"] if row["model"] == "broken.zip")
    assert broken["error"]["code"] and broken["error"]["message"]
    made = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert made == ["brisk-model.tar.gz", "packed-model.tar.gz", "unpacked-model.tar.gz"]
    (garage / "broken.zip").unlink()
    (tmp_path / "again").mkdir()
    said = paddock("export", garage, "--to", tmp_path / "again")
    assert said.status == 0 and "3 models: 3 done, 0 failed" in said.out


def test_a_folder_without_models_is_refused(paddock, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    said = paddock("evaluate", tmp_path, "--track", "oval")
    assert (said.status, said.code) == (2, "home_folder_empty")


@pytest.mark.parametrize("options", [("--name", "Bolt"), ()])
def test_what_belongs_to_one_model_is_refused_for_many(paddock, garage, options):
    more = options or (garage / "brisk.json",)
    said = paddock("upload", garage, *more, "--site", "http://127.0.0.1:9")
    assert (said.status, said.code) == (2, "home_command_line")


def test_a_missing_token_ends_the_work_at_once(paddock, garage):
    said = paddock("upload", garage, "--json")
    assert said.status == 1
    assert {row["error"]["code"] for row in said.json["models"]} == {"site_missing"}


@pytest.mark.slow
def test_all_models_of_a_folder_race_at_home(paddock, garage):
    said = paddock("evaluate", garage, "--track", "oval", "--rule", "laps=1", "--json")
    assert said.status == 0
    assert [row["result"]["complete_laps"] for row in said.json["models"]] == [1, 1, 1]
    first = paddock("evaluate", garage / "unpacked", "--track", "oval", "--rule", "laps=1", "--json")
    assert first.json["sha256"] == said.json["models"][1]["result"]["sha256"]


@needs_shared
def test_a_model_of_the_console_is_read_unpacked(paddock, tmp_path):
    with tarfile.open(CONSOLE_CAR) as tar:
        tar.extractall(tmp_path / "console", filter="data")
    assert names(tmp_path) == ["console"]
    said = paddock("export", tmp_path / "console", "--to", tmp_path / "car.tar.gz")
    assert said.status == 0, said.err


def test_the_checkout_is_no_model():
    with pytest.raises(UserFault, match="contains no model"):
        models_in(CHECKOUT / "docs")
