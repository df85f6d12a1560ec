import platform
from importlib import metadata

from paddock.simulator import engine


def test_versions_are_those_the_packages_report():
    names = {"pybullet": "pybullet", "numpy": "numpy", "opencv": "opencv-python-headless"}
    found = engine.versions()
    assert found.pop("libc").startswith("glibc 2.") or platform.libc_ver()[0] != "glibc"
    assert found.pop("python") == platform.python_version()
    assert found == {short: metadata.version(name) for short, name in names.items()}


def test_a_package_without_its_own_folder_is_still_found(monkeypatch):
    monkeypatch.setattr(engine.os, "listdir", lambda folder: [])
    assert engine._version("numpy") == metadata.version("numpy")
