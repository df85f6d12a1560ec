#!/bin/sh
# Makes the virtual environment with the best Python at hand, and prints which one and why.
#   choose-python.sh [VENV]     .venv unless another folder is named
# The first that works: the Python that PYTHON= names; a python3.11, which has a PyBullet wheel; a Python 3.11 that uv
# downloads; the system's Python with a wheel that was built before; the same after building that wheel.
set -eu

venv=${1:-.venv}
here=$(dirname "$0")
kept="${XDG_CACHE_HOME:-${HOME:-/var/tmp}/.cache}/paddock"
seconds=20 # the longest that uv may wait for an answer

fail() {
    echo "$*" >&2
    exit 1
}
step() { echo "${STEPS:+[2/$STEPS] }$*"; }
version_of() { "$1" -c 'import sys; print("%d.%d.%d" % sys.version_info[:3])' 2>/dev/null; }
supported() { # its version, the modules of virtual environments, no free threading
    "$1" -c 'import ensurepip, sys, sysconfig, venv
sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14) or bool(sysconfig.get_config_var("Py_GIL_DISABLED")))' 2>/dev/null
}
wheel_of() { "$1" "$here/build_pybullet.py" --state 2>/dev/null || :; } # published, built or missing

make_venv() { # make_venv PYTHON WHY
    begun=$(date +%s)
    step "Python $(version_of "$1") ($(command -v "$1")): $2"
    "$1" -m venv "$venv"
    echo "  $(($(date +%s) - begun)) s"
    exit 0
}

# Of an existing environment: empty when it works, else why it does not
broken() {
    made_for=$(sed -n 's/^version[a-z_]* *= *\([0-9]*\.[0-9]*\).*/\1/p' "$venv/pyvenv.cfg" 2>/dev/null | head -n 1)
    now=$(version_of "$venv/bin/python" || :)
    if [ -z "$now" ]; then
        echo "its Python ${made_for:+$made_for }is gone"
    elif [ "$made_for" != "${now%.*}" ]; then
        echo "its Python was ${made_for:-another} and is ${now%.*} now"
    elif ! supported "$venv/bin/python"; then
        echo "Python $now is not supported"
    elif [ -n "${PYTHON:-}" ] && [ "$(version_of "$PYTHON" || :)" != "$now" ]; then
        echo "PYTHON=$PYTHON is another than its Python $now"
    fi
}

if [ -n "${PYTHON:-}" ]; then
    found=$(version_of "$PYTHON") || fail "PYTHON=$PYTHON does not run; name a Python 3.11 to 3.14, or none."
    supported "$PYTHON" || fail "PYTHON=$PYTHON is Python $found: Paddock needs 3.11 to 3.14 with the modules venv and ensurepip (on Debian: python3-venv)."
fi
if [ -e "$venv" ] || [ -L "$venv" ]; then
    why=$(broken)
    [ -n "$why" ] || exit 0
    [ -e "$venv/pyvenv.cfg" ] || [ -z "$(ls -A "$venv" 2>/dev/null)" ] || fail "$venv is no virtual environment; move it away."
    step "$venv is made anew: $why"
    rm -rf "$venv"
fi

build() { # build PYTHON WHY
    "$1" "$here/build_pybullet.py" --build || return 1
    make_venv "$1" "$2"
}

if [ -n "${PYTHON:-}" ]; then
    case $(wheel_of "$PYTHON") in
    missing) build "$PYTHON" "named by PYTHON; its PyBullet wheel was built" || exit 1 ;;
    *) make_venv "$PYTHON" "named by PYTHON" ;;
    esac
fi

for python in python3.11 python3; do
    ! supported $python || [ "$(wheel_of $python)" != published ] || make_venv $python "found on the path"
done

# uv is in the lock of our tools; whatever it cannot do, the next way is tried
install_uv() { # a program of one file, moved in one step: another checkout may do the same
    supported python3 || return 1
    mkdir -p "$kept/bin" || return 1
    made="$kept/uv.$$"
    trap 'rm -rf "$made"' EXIT
    python3 -m venv "$made" || return 1
    sed -n '/^uv==/,/[^\\]$/p' "$here/../locks/tools.txt" >"$made/uv.txt"
    timeout 120 "$made/bin/python" -m pip install --quiet --disable-pip-version-check --timeout $seconds --retries 1 \
        --no-deps --require-hashes --requirement "$made/uv.txt" || return 1
    mv -f "$made/bin/uv" "$1"
}
from_uv() {
    uv=$(command -v uv || echo "$kept/bin/uv")
    export UV_PYTHON_INSTALL_DIR="${UV_PYTHON_INSTALL_DIR:-$kept/python}"
    "$uv" --version >/dev/null 2>&1 || (install_uv "$uv") || return 1
    python=$("$uv" python find --managed-python --no-python-downloads 3.11) || {
        UV_HTTP_TIMEOUT="${UV_HTTP_TIMEOUT:-$seconds}" UV_HTTP_RETRIES="${UV_HTTP_RETRIES:-1}" \
            timeout 180 "$uv" python install --no-bin 3.11 || return 1
        python=$("$uv" python find --managed-python --no-python-downloads 3.11) || return 1
    }
    supported "$python" && echo "$python"
}
if [ "$(uname -m)" = x86_64 ]; then
    step "No python3.11 on the path: asking uv for one"
    ! python=$(from_uv 2>/dev/null) || [ "$(wheel_of "$python")" != published ] || make_venv "$python" "provided by uv"
fi

system=""
for python in python3 python3.13 python3.12 python3.14 python3.11; do
    supported "$python" || continue
    [ "$(wheel_of "$python")" != built ] || make_venv "$python" "its PyBullet wheel was built before"
    system=${system:-$python}
done
[ -n "$system" ] || fail "Paddock needs Python 3.11 to 3.14 with the module venv; on Debian: sudo apt-get install -y python3-venv"
step "No Python 3.11 available: compiling PyBullet for Python $(version_of "$system")"
build "$system" "its PyBullet wheel was built" || exit 1
