#!/bin/sh
# Installs the Debian packages that Paddock needs, where it may; says what to type where it may not.
#   system-packages.sh run     what the site and its workers need
#   system-packages.sh test    the same, and what the tests start: a browser, PostgreSQL, Redis, other processors
set -eu

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
have_compiler() { have cc || have gcc || have clang; }
have_korean() { have fc-list && fc-list :lang=ko | grep -q .; }

need bubblewrap have bwrap
need python3-venv python3 -c 'import ensurepip, venv'
want gcc have_compiler # draws what cars see, several times faster
if [ "${1:-run}" = test ]; then
    need chromium have chromium
    need postgresql have_postgres
    need redis-server have redis-server
    need fonts-noto-cjk have_korean
    need gettext have msgfmt
    [ "$(uname -m)" != x86_64 ] || need qemu-user have qemu-x86_64
fi

[ -n "$missing$wanted" ] || exit 0
if ! have apt-get >/dev/null; then
    [ -n "$missing" ] || exit 0
    echo "Paddock needs these programs, by their Debian names:$missing. Install them with your system's package manager." >&2
    exit 1
fi
if [ "$(id -u)" -ne 0 ]; then
    if [ -z "$missing" ]; then
        echo "Paddock is faster with:$wanted. Type: sudo apt-get install -y$wanted" >&2
        exit 0
    fi
    echo "Paddock needs some system packages. Type this, then run make again:" >&2
    echo "    sudo apt-get update && sudo apt-get install -y$missing$wanted" >&2
    exit 1
fi
install() {
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $1 >/dev/null
}
echo "Installing$missing$wanted"
apt-get update -qq || [ -z "$missing" ]
[ -z "$missing" ] || install "$missing"
[ -z "$wanted" ] || install "$wanted" || echo "Paddock goes on without:$wanted" >&2
