"""``scripts/try-system.sh``: its arguments, and what a step finds in the system that it enters."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.shared import CHECKOUT
from tests.streams.process import free_port

SCRIPT = CHECKOUT / "scripts/try-system.sh"
HOME = Path("~root").expanduser()  # in the system, too
# Instead of a download: a system whose programs are those of this machine, bound to the same place
DEBOOTSTRAP = """#!/bin/sh
for target; do case $target in *.new) break ;; esac; done
mkdir -p $target/usr
cd $target
mkdir -p proc sys dev tmp run mnt root home/racer etc
for folder in bin sbin lib lib64; do ln -s usr/$folder $folder; done
cp /etc/passwd /etc/group etc
cp -a /etc/alternatives etc
echo "racer:x:1234:1234::/home/racer:/bin/sh" >> etc/passwd
echo "racer:x:1234:" >> etc/group
echo "made $*" >> ../made
"""


def may_enter() -> bool:
    """Whether this user and kernel allow namespaces, as a container often does not."""
    try:
        return os.getuid() == 0 and not subprocess.run(["unshare", "--mount", "--pid", "--fork", "true"]).returncode
    except OSError:
        return False


needs_root = pytest.mark.skipif(not may_enter(), reason="only root may make and enter a system")


def call(
    *arguments: str, script: Path = SCRIPT, path: str = os.environ["PATH"], **environment: str
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [script, *arguments],
        env={"PATH": path, **environment},
        capture_output=True,
        text=True,
        timeout=120,
        umask=0o077,  # the strictest that a root has: the ordinary user of the system still reads it
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "name a system and a step"),
        (("trixie",), "name a system and a step"),
        (("--fast", "trixie", "start"), "there is no option --fast"),
        (("--roots",), "--roots needs a value"),
        (("--rest", "long", "trixie", "start"), "--rest long: not a number of seconds"),
        (("--env", "NO_SUCH_VARIABLE", "trixie", "start"), "--env NO_SUCH_VARIABLE: no such variable"),
        (("--bind", "/no/such/place:/here", "trixie", "start"), "--bind /no/such/place: no such file or folder"),
        (("../trixie", "start"), "the name of a system"),
        (("--checkout", "../other", "trixie", "start"), "the name of a system or a checkout"),
    ],
)
def test_wrong_arguments_are_explained_and_nothing_is_made(arguments, words, tmp_path):
    done = call("--roots", str(tmp_path), *arguments)
    assert done.returncode == 2 and words in done.stderr and not done.stdout
    assert not list(tmp_path.iterdir())


def test_the_help_names_every_system_step_and_option():
    done = call("--help")
    assert done.returncode == 0 and not done.stderr
    for word in ("bookworm", "trixie", "noble", "start", "test", "journey", "golden", "COMMAND"):
        assert word in done.stdout
    accepted = {word for word in SCRIPT.read_text().replace("|", " ").replace(")", " ").split() if word[:2] == "--"}
    assert {"--user", "--offline", "--again", "--checkout", "--env", "--bind"} < accepted
    assert "set -eu" not in done.stdout


def test_an_ordinary_user_cannot_make_a_system(tmp_path):
    (tmp_path / "id").write_text("#!/bin/sh\necho 1000\n")
    (tmp_path / "id").chmod(0o755)
    done = call("trixie", "start", path=f"{tmp_path}:{os.environ['PATH']}")
    assert done.returncode == 1 and "only root" in done.stderr


@needs_root
def test_an_ubuntu_needs_its_keys(systems):
    done = systems("--keys", "/no/such/keys", "noble", "true")
    assert done.returncode == 1 and "install ubuntu-keyring" in done.stderr


@pytest.fixture
def systems(tmp_path):
    """Call it with a debootstrap that makes a small system at once, of a small checkout."""
    programs, roots, scripts = tmp_path / "programs", tmp_path / "roots", tmp_path / "checkout/scripts"
    programs.mkdir()
    scripts.mkdir(parents=True)
    shutil.copy(SCRIPT, scripts)
    shutil.copy(CHECKOUT / ".gitignore", scripts.parent)
    (scripts.parent / "manage.py").touch()
    for name, text in {"debootstrap": DEBOOTSTRAP, "pivot_root": '#!/bin/sh\nexec /usr/sbin/pivot_root "$@"\n'}.items():
        (programs / name).write_text(text)
        (programs / name).chmod(0o755)

    def try_it(
        *arguments: str, script: Path = scripts / SCRIPT.name, **environment: str
    ) -> subprocess.CompletedProcess[str]:
        return call(
            *("--roots", str(roots), "--bind", "/usr", *arguments),
            script=script,
            path=f"{programs}:/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
            **environment,
        )

    return try_it


@pytest.fixture
def make(tmp_path):
    """Call it with a program that stands in for make; the arguments put it into a system."""

    def put(program: str) -> tuple[str, ...]:
        folder = tmp_path / "make"
        folder.mkdir()
        folder.chmod(0o755)
        (folder / "make").write_text(program)
        (folder / "make").chmod(0o755)
        return "--bind", f"{folder}:/programs", "--env", "PATH=/programs:/usr/bin:/bin"

    return put


@needs_root
def test_a_step_runs_in_a_copy_of_the_checkout_with_namespaces_of_its_own(systems):
    program = "pwd; ls; ls -A / /mnt; unshare --user --map-root-user id -u"
    done = systems("trixie", "sh", "-c", program, script=SCRIPT)
    assert (done.returncode, done.stderr) == (0, "")
    words = done.stdout.split()
    assert f"{HOME}/paddock" in words and "manage.py" in words and "work" not in words
    assert words[-1] == "0"  # a user namespace, which the kernel refuses in a plain chroot


@needs_root
def test_an_ordinary_user_owns_the_copy_and_sees_the_named_variables_alone(systems):
    arguments = ("--user", "--env", "SHOWN", "--env", "GIVEN=two words")
    done = systems(*arguments, "trixie", "sh", "-c", "id -un; touch manage.py; env; exit 7", SHOWN="yes", HIDDEN="yes")
    assert done.returncode == 7 and not done.stderr
    lines = done.stdout.splitlines()
    assert lines[1] == "racer" and "HOME=/home/racer" in lines
    assert "SHOWN=yes" in lines and "GIVEN=two words" in lines and not any("HIDDEN" in line for line in lines)


@needs_root
@pytest.mark.skipif(not shutil.which("ip"), reason="iproute2 is not installed")
def test_offline_there_is_the_loopback_alone(systems):
    done = systems("--offline", "trixie", "sh", "-c", "grep -c : /proc/net/dev; ip -brief address")
    assert done.stdout.splitlines()[1] == "1" and "127.0.0.1" in done.stdout


@needs_root
def test_a_try_makes_a_new_system_unless_it_continues_the_last(systems):
    left = f"ls {HOME}/*/left; touch left; pwd"
    assert "left" not in systems("trixie", "sh", "-c", left).stdout
    assert f"{HOME}/paddock/left" in systems("--again", "trixie", "sh", "-c", left).stdout
    second = systems("--again", "--checkout", "second", "trixie", "sh", "-c", left).stdout
    assert f"{HOME}/paddock/left" in second and f"{HOME}/second\n" in second
    assert "left" not in systems("trixie", "sh", "-c", left).stdout


@needs_root
def test_a_system_is_made_once(systems, tmp_path):
    for _ in range(2):
        assert systems("trixie", "true").returncode == 0
    assert len((tmp_path / "roots/made").read_text().splitlines()) == 1


@needs_root
def test_root_types_what_make_asks_an_ordinary_user_for(systems, make):
    arguments = make(
        "#!/bin/sh\n[ ! -e /second ] || exec echo $* passed\n"
        'echo "    sudo touch $([ -e /first ] && echo /second || echo /first) && sudo true"; exit 1\n'
    )
    done = systems("--user", *arguments, "trixie", "test")
    typed = [line for line in done.stdout.splitlines() if line.startswith("root types: ")]
    assert typed == ["root types: sudo touch /first && sudo true", "root types: sudo touch /second && sudo true"]
    assert done.returncode == 0 and "test passed" in done.stdout


@needs_root
def test_a_command_that_did_not_help_is_typed_once(systems, make):
    done = systems("--user", *make("#!/bin/sh\necho '    sudo true'; exit 3\n"), "trixie", "test")
    assert done.returncode != 0 and done.stdout.count("root types: sudo true") == 1


@needs_root
def test_a_start_is_measured_twice(systems, make):
    arguments = make(
        "#!/usr/bin/python3\nimport os, signal, sys\n"
        "assert signal.getsignal(signal.SIGINT) is not signal.SIG_IGN\n"
        "run = 'import signal; print(\"Paddock is ready\", flush=True); signal.pause()'\n"
        "if sys.argv[1] == 'run':\n    os.execvp('python3', ['python3', '-c', run])\n"
    )
    done = systems("--rest", "0", *arguments, "trixie", "start")
    setup, first, second = (line for line in done.stdout.splitlines() if line.endswith((" ms", " at rest")))
    assert setup.startswith("Setup: ")
    assert first.startswith("First start: ") and second.startswith("Second start: ")
    assert "ms until the site answers" in first and "(PSS of 1 processes) at rest" in first
    assert "(PSS of 1 processes) at rest" in second


@pytest.mark.soak
@needs_root
@pytest.mark.skipif(not shutil.which("debootstrap", path="/usr/sbin:/sbin"), reason="debootstrap is not installed")
def test_paddock_starts_in_a_debian_12(tmp_path):
    """By pip's settings of this machine; it needs a network."""
    options = ["--env", f"PORT={free_port()}"]
    for name in filter(lambda name: name.startswith("PIP_"), os.environ):
        value = os.environ[name]
        if value.startswith("/") and Path(value).exists():
            options += ["--bind", f"{value}:/settings/{name}"]
            value = f"/settings/{name}"
        options += ["--env", f"{name}={value}"]
    done = subprocess.run(
        [SCRIPT, "--roots", tmp_path, "--rest", "5", *options, "bookworm", "start"],
        capture_output=True,
        text=True,
        timeout=3600,
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr
    assert "Setup: " in done.stdout and "First start: " in done.stdout and "Second start: " in done.stdout
