"""A racer's own car, read at home, is the car that a site would keep; what it cannot be is said."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from paddock.errors import UserFault
from paddock.packages.own import read_car
from tests.shared import CHECKOUT
from training.golden.cars import car

STEADY = CHECKOUT / "training" / "house_cars" / "steady"


def renamed(folder: Path) -> list[Path]:
    files = [folder / "model.onnx", folder / "model_metadata.json"]
    for path, source in zip(files, (".onnx", ".json"), strict=True):
        path.write_bytes(STEADY.with_suffix(source).read_bytes())
    return files


def test_it_is_the_car_that_a_site_would_keep(tmp_path):
    read, kept = read_car(renamed(tmp_path)), car("steady")
    assert (read.sha256, read.onnx, read.metadata) == (kept.sha256, kept.onnx, kept.metadata)


def test_a_zip_of_stable_baselines3_is_for_a_site(tmp_path):
    path = tmp_path / "model.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for name in ("data", "policy.pth", "pytorch_variables.pth", "_stable_baselines3_version"):
            archive.writestr(name, "2.7.0")
    (tmp_path / "model_metadata.json").write_bytes(STEADY.with_suffix(".json").read_bytes())
    with pytest.raises(UserFault) as caught:
        read_car([path, tmp_path / "model_metadata.json"])
    assert caught.value.code == "sb3_at_home"


def test_a_network_that_a_site_refuses_is_refused_with_its_reason(tmp_path):
    network, metadata = renamed(tmp_path)
    network.write_bytes(b"no network")
    with pytest.raises(UserFault) as caught:
        read_car([network, metadata])
    assert caught.value.code == "not_a_model"


def test_a_file_that_is_not_there_is_the_systems_word(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_car([tmp_path / "model.onnx"])
