"""The engine has no Linux in it: it is imported whole, and drives, where what only Linux has is missing.

Other systems are not at hand here. What is: a process in which the modules and functions of Linux are gone before the
first line of the engine is read."""

from __future__ import annotations

import subprocess
import sys

from tests.shared import CHECKOUT

MODULES = (
    "fcntl",
    "resource",
    "pwd",
    "grp",
    "termios",
    "tty",
    "pty",
    "syslog",
    "crypt",
    "spwd",
    "pyseccomp",
    "seccomp",
)
FUNCTIONS = """
sched_getaffinity sched_setaffinity sched_setscheduler fork forkpty posix_spawn readv writev preadv confstr sysconf nice
getuid geteuid getgid setuid setsid setpgid killpg wait3 wait4 waitid pipe2 memfd_create splice sendfile uname mkfifo
getloadavg chroot O_NOFOLLOW O_CLOEXEC O_NONBLOCK set_blocking get_blocking
""".split()  # noqa: SIM905  (a list of words is read sooner)

PROGRAM = f"""
import importlib, os, pkgutil, select, signal, sys
import cv2, gymnasium, numpy, onnx, onnxruntime, pybullet  # what other systems have wheels or sources of

for name in {MODULES!r}:
    sys.modules[name] = None  # an import of it fails
for name in {FUNCTIONS!r}:
    if hasattr(os, name): delattr(os, name)
del select.poll, select.epoll
for name in ("SIGKILL", "SIGHUP", "SIGXCPU", "SIGALRM", "alarm", "setitimer"): delattr(signal, name)
usual_open = open
def no_proc(path, *more, **named):
    if str(path).startswith(("/proc", "/sys")): raise FileNotFoundError(path)
    return usual_open(path, *more, **named)
import builtins; builtins.open = no_proc

import paddock
count = 0
for one in pkgutil.walk_packages(paddock.__path__, "paddock."):
    name = one.name.split(".")[-1]
    if name.isidentifier() and name not in ("sb3", "__main__"):
        importlib.import_module(one.name); count += 1

from pathlib import Path
from paddock.cli.driving import track_here
from paddock.packages.own import read_car
from paddock.rules.race import RaceRules
from paddock.simulator.engine import versions
from paddock.simulator.own import drive

cars = [read_car([Path("training/house_cars/flyer.onnx"), Path("training/house_cars/flyer.json")])]
rules = RaceRules(race_type="head_to_head", bots=2, max_simulated_ms=1000)
run = drive(track_here("oval"), rules, cars)
env = gymnasium.make("Paddock/ObjectAvoidance-v1", metadata={{
    "action_space_type": "continuous", "sensor": ["STEREO_CAMERAS", "SECTOR_LIDAR"],
    "action_space": {{"steering_angle": {{"low": -30, "high": 30}}, "speed": {{"low": 1, "high": 4}}}}}})
env.reset(seed=1)
for _ in range(3): env.step(env.action_space.sample())
print(count, run.result.steps, versions()["libc"])
"""


def test_the_engine_is_imported_and_drives_without_linux():
    command = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(command, capture_output=True, text=True, cwd=CHECKOUT)
    assert done.returncode == 0, done.stderr
    count, steps, libc = done.stdout.strip().split("\n")[-1].split()
    assert int(count) > 90 and int(steps) == 15 and libc == "unknown"
