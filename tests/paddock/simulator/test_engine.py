import platform
from importlib import metadata

from paddock.simulator import engine


def test_the_versions_are_those_that_the_packages_say_themselves():
    names = {"pybullet": "pybullet", "numpy": "numpy", "opencv": "opencv-python-headless"}
    found = engine.versions()
    assert found.pop("libc").startswith("glibc 2.") or platform.libc_ver()[0] != "glibc"
    assert found.pop("python") == platform.python_version()
    assert found == {short: metadata.version(name) for short, name in names.items()}


def test_a_package_without_a_folder_of_its_name_is_looked_up_the_long_way(monkeypatch):
    monkeypatch.setattr(engine.os, "listdir", lambda folder: [])
    assert engine._version("numpy") == metadata.version("numpy")
