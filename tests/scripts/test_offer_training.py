"""What ``make run`` does about training, against a counterfeit index: the real script, the real pip."""

from __future__ import annotations

import importlib.util
import os
import platform
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import pip
import pytest

from tests.scripts.torch_index import Index, Wheel
from tests.shared import CHECKOUT

SCRIPTS = CHECKOUT / "scripts"
TAG = f"cp{sys.version_info.major}{sys.version_info.minor}"
BUILD = Wheel("torch", "2.13.0+cpu", f"{TAG}-{TAG}-manylinux_2_28_{platform.machine()}", ballast=400_000)
CUDA = Wheel("torch", "2.13.0", f"{TAG}-{TAG}-manylinux_2_28_{platform.machine()}", requires=("nvidia_cublas==1.0",))
NVIDIA = Wheel("nvidia_cublas", "1.0")
SB3 = Wheel("stable_baselines3", "2.9.2")
OPTUNA = Wheel("optuna", "5.0.0")
LATER = "The site runs without training models; “make training” adds it."


@dataclass
class Machine:
    """A checkout with a virtual environment of its own."""

    folder: Path
    environment: dict[str, str]

    @property
    def python(self) -> Path:
        return self.folder / ".venv" / "bin" / "python"

    @property
    def kept(self) -> list[str]:
        return [path.name for path in self.folder.glob("cache/paddock/wheels/*")]

    def offer(self, *arguments: str, **environment: str) -> tuple[int, str]:
        """The script's exit status and output."""
        command = [str(self.python), "scripts/offer_training.py", *arguments]
        ran = subprocess.run(
            command,
            cwd=self.folder,
            env={**self.environment, **environment},
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        assert not ran.stderr
        return ran.returncode, ran.stdout

    def installed(self) -> list[str]:
        listed = self.folder.glob(".venv/lib/python*/site-packages/*.dist-info")
        return sorted(path.stem for path in listed if not path.stem.startswith(("pip-", "setuptools-")))


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with pip alone."""
    folder = tmp_path_factory.mktemp("plain") / ".venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    ours = Path(pip.__file__).parent  # a copy; unpacking the one of Python takes it seconds
    for part in (ours, *ours.parent.glob("pip-*.dist-info")):
        shutil.copytree(part, packages / part.name)
    return folder


@pytest.fixture
def index() -> Iterator[Index]:
    """``cpu``: the publisher's; ``pypi``: the one that pip is configured with."""
    with Index() as served:
        served.add("pypi", CUDA)
        served.add("pypi", NVIDIA)
        yield served


@pytest.fixture
def machine(tmp_path: Path, plain: Path, index: Index) -> Machine:
    """It knows the hash of the build on the counterfeit index."""
    shutil.copytree(plain, tmp_path / ".venv", symlinks=True)
    for name in ("offer_training.py", "pip_progress.py"):
        target = tmp_path / "scripts" / name
        target.parent.mkdir(exist_ok=True)
        shutil.copy(SCRIPTS / name, target)
    (tmp_path / "locks").mkdir()
    (tmp_path / "locks" / "torch.sha256").write_text(f"{index.add('cpu', BUILD)}  {BUILD.file}\n")
    locked = [f"{one.name}=={one.version} --hash=sha256:{index.add('pypi', one)}\n" for one in (SB3, OPTUNA)]
    (tmp_path / "locks" / "training.txt").write_text("".join(locked))
    (tmp_path / "constraints.txt").write_text("torch==2.13.0\n")
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("PIP_")}
    here = {
        "PIP_CONFIG_FILE": os.devnull,
        "PIP_DISABLE_PIP_VERSION_CHECK": "1",
        "PIP_INDEX_URL": index.url("pypi"),
        "TORCH_INDEX": index.url("cpu"),
        "XDG_CACHE_HOME": str(tmp_path / "cache"),
        "TRAINING": "",
    }
    return Machine(tmp_path, inherited | here)


ALL = ["optuna-5.0.0", "stable_baselines3-2.9.2", "torch-2.13.0+cpu"]


def test_the_publishers_build_is_installed_by_its_hash(machine, index) -> None:
    status, printed = machine.offer(STEP="4", STEPS="4")
    assert (status, machine.installed()) == (0, ALL), printed
    assert "\n[4/4] Downloading 0 MB of PyTorch (leave it out: make run TRAINING=no) ..." in printed
    assert index.fetched() == [BUILD.file, SB3.file, OPTUNA.file] and "make training" not in printed


@pytest.mark.slow
def test_a_second_checkout_installs_the_kept_wheel_without_an_index(machine, index) -> None:
    machine.offer()
    asked = len(index.asked)
    shutil.rmtree(
        machine.folder / ".venv" / "lib" / "python{}.{}".format(*sys.version_info) / "site-packages" / "torch"
    )
    machine.offer(TORCH_INDEX="http://127.0.0.1:1")
    assert machine.installed() == ALL
    assert not [path for path in index.asked[asked:] if "torch" in path]


def test_a_build_of_another_content_is_refused(machine, index) -> None:
    index.add("cpu", BUILD)
    status, printed = machine.offer()
    assert (status, machine.installed(), machine.kept) == (0, [], [])
    assert "Refused " in printed and f"/{BUILD.file}: its SHA-256 is not that of locks/torch.sha256" in printed
    assert printed.endswith(f"{LATER}\n")
    assert machine.offer("--always")[0] == 1 and not machine.installed(), "nor anything else in its place"


def test_cuda_is_never_downloaded_unasked(machine, index) -> None:
    status, printed = machine.offer(TORCH_INDEX=index.url("empty"))
    assert (status, machine.installed(), index.fetched()) == (0, [], [])
    assert f"PyTorch's build for processors was not found ({BUILD.file})." in printed and LATER in printed


@pytest.mark.slow
def test_make_training_takes_the_build_and_else_what_pip_finds(machine, index) -> None:
    assert machine.offer("--always")[0] == 0 and machine.installed() == ALL
    nothing = {"TORCH_INDEX": index.url("empty"), "XDG_CACHE_HOME": str(machine.folder / "other")}
    subprocess.run([machine.python, "-m", "pip", "uninstall", "--quiet", "--yes", "torch"], check=True)
    status, printed = machine.offer("--always", **nothing)
    assert (status, "torch-2.13.0" in machine.installed()) == (0, True), printed
    assert "nvidia_cublas-1.0" in machine.installed()


@pytest.mark.slow
def test_make_training_fails_where_nothing_is_found(machine, index) -> None:
    status, printed = machine.offer("--always", TORCH_INDEX=index.url("empty"), PIP_INDEX_URL=index.url("empty"))
    assert status == 1 and LATER in printed


@pytest.mark.slow
@pytest.mark.parametrize("answers", [False, True], ids=["refuses", "is silent"])
def test_an_unreachable_index_costs_seconds(machine, answers) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = listening.getsockname()[1]
        if not answers:
            listening.close()
        begun = time.monotonic()
        status, printed = machine.offer(TORCH_INDEX=f"http://127.0.0.1:{port}/cpu")
        assert time.monotonic() - begun < 20
    assert (status, machine.installed()) == (0, []) and LATER in printed


def test_training_can_be_left_out(machine, index) -> None:
    assert machine.offer(TRAINING="no") == (0, f"{LATER}\n")
    assert not index.asked and not machine.installed()


@pytest.mark.slow
def test_nothing_is_looked_up_where_training_is_installed(machine, index) -> None:
    machine.offer()
    asked = len(index.asked)
    assert machine.offer() == (0, "") and len(index.asked) == asked


@pytest.mark.slow
def test_what_an_older_installation_lacks_is_added(machine, index) -> None:
    machine.offer()
    subprocess.run([machine.python, "-m", "pip", "uninstall", "--quiet", "--yes", "optuna"], check=True)
    fetched = len(index.fetched())
    assert machine.offer()[0] == 0 and machine.installed() == ALL
    assert index.fetched()[fetched:] == [OPTUNA.file]


@pytest.mark.slow
def test_a_folder_comes_before_the_publisher(machine, index) -> None:
    wheels = machine.folder / "wheels"
    wheels.mkdir()
    (wheels / BUILD.file).write_bytes(index.wheels["cpu"][BUILD.file][1])
    status, printed = machine.offer(PIP_FIND_LINKS=str(wheels))
    assert (status, machine.installed()) == (0, ALL) and "Downloading" not in printed
    assert BUILD.file not in index.fetched() and not any(path.startswith("/cpu") for path in index.asked)


@pytest.mark.slow
def test_a_damaged_file_in_a_folder_is_refused_and_the_publisher_asked(machine, index) -> None:
    wheels = machine.folder / "wheels"
    wheels.mkdir()
    (wheels / BUILD.file).write_bytes(BUILD.content())
    status, printed = machine.offer(PIP_FIND_LINKS=str(wheels))
    assert (status, machine.installed()) == (0, ALL)
    assert "Refused " in printed and "Downloading" in printed
    assert (wheels / BUILD.file).exists(), "the folder is somebody else's"


@pytest.mark.slow
def test_a_mirror_that_has_the_build_comes_before_the_publisher(machine, index) -> None:
    index.wheels["pypi"][BUILD.file] = index.wheels["cpu"][BUILD.file]
    assert machine.offer()[0] == 0 and machine.installed() == ALL
    assert not any(path.startswith("/cpu") for path in index.asked)


@pytest.mark.slow
def test_a_broken_download_is_continued(machine, index) -> None:
    index.cut = 150_000
    status, printed = machine.offer()
    assert (status, machine.installed()) == (1, [])
    assert re.search(
        r"The download of PyTorch broke off at 0 of 0 MB \(.+\); the next “make run” continues it\.", printed
    )
    index.cut = None
    assert machine.offer()[0] == 0 and machine.installed() == ALL
    assert index.ranges[:2] == ["bytes=0-", "bytes=150000-"]


@pytest.mark.slow
def test_ctrl_c_stops_a_download_that_the_next_one_continues(machine, index) -> None:
    index.cut, index.hold = 150_000, threading.Event()
    command = [str(machine.python), "scripts/offer_training.py"]
    with subprocess.Popen(
        command, cwd=machine.folder, env=machine.environment, stdout=subprocess.PIPE, text=True
    ) as offering:
        assert index.reached.wait(30)
        part = machine.folder / "cache" / "paddock" / "wheels" / f"{BUILD.file}.part"
        until = time.monotonic() + 10
        while part.stat().st_size < 100_000 and time.monotonic() < until:
            time.sleep(0.02)
        offering.send_signal(signal.SIGINT)
        try:
            printed = offering.communicate(timeout=30)[0]
        finally:
            offering.kill()
    assert offering.returncode == 130 and "“make run TRAINING=no” starts the site without it" in printed
    index.hold.set()
    index.cut = index.hold = None
    assert machine.offer()[0] == 0 and machine.installed() == ALL
    assert index.ranges[1] != "bytes=0-"


@pytest.mark.slow
def test_a_python_without_a_locked_build_leaves_training_out(machine, index) -> None:
    lock = machine.folder / "locks" / "torch.sha256"
    lock.write_text(lock.read_text().replace(f"-{TAG}-{TAG}-", "-cp310-cp310-"))
    status, printed = machine.offer()
    assert status == 0 and f"No PyTorch is locked for Python {platform.python_version()}" in printed
    assert LATER in printed and not index.asked


@pytest.fixture
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("offer_training", SCRIPTS / "offer_training.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_full_disk_is_found_out_before_the_download(script, monkeypatch, tmp_path, index, capsys) -> None:
    digest = index.add("cpu", BUILD)
    (tmp_path / "torch.sha256").write_text(f"{digest}  {BUILD.file}\n")
    monkeypatch.setattr(script, "LOCK", tmp_path / "torch.sha256")
    monkeypatch.setattr(script, "CACHE", tmp_path)
    monkeypatch.setattr(script, "_look", lambda name: f"{index.url('cpu')}/{BUILD.file}")
    monkeypatch.setattr(script.subprocess, "run", lambda *a, **o: subprocess.CompletedProcess(a, 1))
    monkeypatch.setattr(script, "find_spec", lambda name: None)
    monkeypatch.setattr(script.shutil, "disk_usage", lambda path: shutil._ntuple_diskusage(9, 9, 1_000_000))
    monkeypatch.setattr(script.sys, "argv", ["offer_training.py"])
    monkeypatch.setenv("TRAINING", "")
    assert script.main() == 0
    assert capsys.readouterr().out.endswith(f"\nPyTorch needs 2 MB on the disk, and 1 MB are free.\n{LATER}\n")
    assert not (tmp_path / f"{BUILD.file}.part").stat().st_size


@pytest.mark.parametrize("minor", [11, 12, 13, 14])
@pytest.mark.parametrize("machine_name", ["x86_64", "aarch64"])
def test_every_supported_python_has_a_locked_build(script, monkeypatch, minor, machine_name) -> None:
    version = re.search(r"^torch==(\S+)$", (CHECKOUT / "constraints.txt").read_text(), re.M)[1]
    monkeypatch.setattr(script.sys, "version_info", type("Version", (), {"major": 3, "minor": minor}))
    monkeypatch.setattr(script.platform, "machine", lambda: machine_name)
    name, digest = script.locked_build(script.LOCK.read_text())
    assert name == f"torch-{version}+cpu-cp3{minor}-cp3{minor}-manylinux_2_28_{machine_name}.whl"
    assert re.fullmatch("[0-9a-f]{64}", digest)
