#!/bin/sh
# Installs the Debian packages that Paddock needs, where it may; says what to type where it may not.
#   system-packages.sh run     what the site and its workers need
#   system-packages.sh test    the same, and what the tests start: a browser, PostgreSQL, Redis, slapd, other processors
#   system-packages.sh ldap    what compiles python-ldap
#   system-packages.sh build [PACKAGE]    what compiles PyBullet: g++ and the package with Python's headers
#   system-packages.sh browser    for the tests, where the system has no package of Chromium: Playwright's Chromium
set -eu

mode=${1:-run}

missing=""
wanted=""
need() { # need PACKAGE test-command...
    package=$1
    shift
    "$@" >/dev/null 2>&1 || missing="$missing $package"
}

want() { # the same, for what Paddock can do without
    package=$1
    shift
    "$@" >/dev/null 2>&1 || wanted="$wanted $package"
}

have() { command -v "$1"; }
have_postgres() { have postgres || ls /usr/lib/postgresql/*/bin/postgres; }
have_slapd() { have slapd || ls "${SBIN:-/usr/sbin}/slapd"; }
have_header() { ls "${INCLUDE:-/usr/include}/$1"; }
have_python_headers() { # python3-dev is for Debian's own Python; others bring them
    .venv/bin/python -c 'import os, sys, sysconfig
sys.exit(sys.base_prefix == "/usr" and not os.path.exists(sysconfig.get_paths()["include"] + "/Python.h"))'
}
have_compiler() { have cc || have gcc || have clang; }
have_korean() { have fc-list && fc-list :lang=ko | grep -q .; }

have_python() { # one that can make virtual environments
    for python in "${PYTHON:-python3}" python3.11 python3; do
        ! "$python" -c 'import ensurepip, venv' || return 0
    done
    return 1
}
have_browser() { # Chromium as a snap cannot read the tests' folders
    for browser in chromium google-chrome google-chrome-stable; do
        case $(command -v $browser || echo /snap/) in /snap/*) ;; *) return 0 ;; esac
    done
    ls "${PLAYWRIGHT_BROWSERS_PATH:-${HOME:-}/.cache/ms-playwright}"/chromium-*/chrome-linux*/chrome
}
has_chromium() { ! grep -qx 'ID=ubuntu' "${OS_RELEASE:-/etc/os-release}"; } # Ubuntu's package is an empty one for the snap
seconds() { date +%s; }

if [ "$mode" = browser ]; then
    ! have_browser >/dev/null 2>&1 || exit 0
    echo "Downloading Playwright's Chromium for the tests"
    [ "$(id -u)" -eq 0 ] && with=--with-deps || with=""
    # shellcheck disable=SC2086
    ! timeout 600 .venv/bin/python -m playwright install $with chromium >/dev/null 2>&1 || exit 0
    echo "Tests in a browser are skipped: install Google Chrome, or, with a network, type" >&2
    echo "    .venv/bin/python -m playwright install chromium && sudo .venv/bin/python -m playwright install-deps chromium" >&2
    exit 0
fi
if [ "$mode" = ldap ]; then
    need libldap2-dev have_header ldap.h
    need libsasl2-dev have_header sasl/sasl.h
    need gcc have_compiler
    need python3-dev have_python_headers
elif [ "$mode" = build ]; then
    need g++ have g++
    [ -z "${2:-}" ] || need "$2" dpkg-query --status "$2"
else
    need bubblewrap have bwrap
    need python3-venv have_python
    want gcc have_compiler # draws what cars see, several times faster
fi
if [ "$mode" = test ]; then
    if has_chromium; then
        need chromium have_browser
        want chromium-headless-shell have chromium-headless-shell # the same pages for half of the processor time
    fi
    need postgresql have_postgres
    need redis-server have redis-server
    want slapd have_slapd # its tests are skipped without these three
    want libldap2-dev have_header ldap.h
    want libsasl2-dev have_header sasl/sasl.h
    need fontconfig have fc-list
    need fonts-noto-cjk have_korean
    need gettext have msgfmt
    [ "$(uname -m)" != x86_64 ] || need qemu-user have qemu-x86_64
fi

if [ -z "$missing$wanted" ]; then
    [ -e .venv ] || [ "$mode" = build ] || [ -z "${STEPS:-}" ] || echo "[1/$STEPS] System packages: nothing is missing"
    exit 0
fi
what="Paddock needs some system packages"
[ "$mode" != build ] || what="PyBullet has a wheel for Python 3.11 alone, and compiling it needs some system packages"
if ! have apt-get >/dev/null; then
    [ -n "$missing" ] || exit 0
    echo "$what, by their Debian names:$missing. Install them with your system's package manager, then run make again." >&2
    exit 1
fi
if [ "$(id -u)" -ne 0 ]; then
    if [ -z "$missing" ]; then
        [ "$mode" = test ] && better="Tests are faster, and fewer skipped, with" || better="Paddock is faster with"
        echo "$better:$wanted. Type: sudo apt-get install -y$wanted" >&2
        exit 0
    fi
    echo "$what. Type this, then run make again:" >&2
    echo "    sudo apt-get update && sudo apt-get install -y$missing$wanted" >&2
    exit 1
fi
install() {
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive DEBCONF_NOWARNINGS=yes apt-get install -y -qq --no-install-recommends $1 >/dev/null
}
begun=$(seconds)
[ "$mode" != build ] || STEPS="" # within the second step
echo "${STEPS:+[1/$STEPS] }Installing$missing$wanted"
apt-get update -qq || : # an old list may do
if [ -n "$missing" ] && ! install "$missing"; then
    echo "$what, which apt-get could not install:$missing. On Ubuntu they are in the component universe." >&2
    exit 1
fi
[ -z "$wanted" ] || install "$wanted" || echo "Paddock goes on without:$wanted" >&2
echo "  $(($(seconds) - begun)) s"
