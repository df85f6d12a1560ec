#!/bin/sh
# Boots a Debian 12 with systemd in a container, types what docs/operators.md says under "systemd", and drives a car, a
# training and a video on the programs that the units start. Then kills, restarts and drains them.
#   sudo scripts/try_units.sh [--place FOLDER]
#
# The last commit is installed. FOLDER holds the system, which is made anew (default: /var/tmp/paddock-units); it shares
# this machine's network, and the site is on port 8198. pip looks where it is configured to look here for wheels.
# It needs root, debootstrap and systemd-container. Where the machine itself runs no systemd, or has cgroups in hybrid
# mode, the system gets a mount of the new cgroups, by which systemd can limit no memory.
set -eu

cd "$(dirname "$0")/.."
. scripts/try_race.sh
place=/var/tmp/paddock-units address=http://127.0.0.1:8198
fail() {
    echo "try_units.sh: $1" >&2
    exit "${2:-1}"
}
case "${1:-}" in
    --help | -h) sed -n '2,/^set/s/^# \{0,1\}//p' "$0" && exit ;;
    --place) place=${2:?} ;;
    ?*) fail "there is no option $1; --help lists all" 2 ;;
esac
[ "$(id -u)" -eq 0 ] || fail "only root can boot a system"
for program in debootstrap systemd-nspawn; do
    command -v $program >/dev/null || fail "$program is missing: apt-get install debootstrap systemd-container"
done

system=$place/system
rm -rf "$system"
mkdir -p "$place"
debootstrap --variant=minbase --include=ca-certificates,dbus,git,make,systemd-sysv bookworm "$system" >"$place/base.log" ||
    fail "$(tail -n 3 "$place/base.log")"
cp /etc/ssl/certs/ca-certificates.crt "$system/etc/ssl/certs/" # of a proxy that this machine trusts
git clone --quiet --bare . "$system/srv/paddock.git"

# systemd 252 forbids Landlock to what it boots
set -- --quiet --register=no --directory="$system" --boot \
    --system-call-filter="landlock_create_ruleset landlock_add_rule landlock_restrict_self"
wheels=$(python3 -m pip config get env.find-links 2>/dev/null || echo "${PIP_FIND_LINKS:-}")
[ ! -d "$wheels" ] || set -- "$@" --bind-ro="$wheels"
if [ -d /run/systemd/system ]; then
    systemd-nspawn "$@" >"$place/boot.log" 2>&1 </dev/null &
else
    # shellcheck disable=SC2016
    unshare --mount sh -c 'umount -R /sys/fs/cgroup && mount -t cgroup2 cgroup2 /sys/fs/cgroup && exec systemd-nspawn --keep-unit "$@"' \
        - "$@" >"$place/boot.log" 2>&1 </dev/null &
fi
booted=$!
trap 'kill $booted; wait $booted || true' EXIT # a shutdown

root() {
    nsenter --target "$(pgrep -P $booted)" --mount --uts --ipc --pid --cgroup env -i HOME=/root LANG=C.UTF-8 PIP_FIND_LINKS="$wheels" \
        DJANGO_SUPERUSER_PASSWORD=correct-horse-7 PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
        sh -c 'cd / && exec "$@"' - "$@"
}
# shellcheck disable=SC2016
inside() {
    root sh -c 'cd /opt/paddock && set -a && . /etc/paddock.env && set +a && exec runuser -u paddock -- env "PATH=$PWD/.venv/bin:$PATH" "$@"' - "$@"
}
wait_for() { # SECONDS WHAT COMMAND...
    seconds=$1 what=$2
    shift 2
    while ! "$@" >/dev/null 2>&1; do
        [ $((seconds -= 1)) -gt 0 ] || fail "not $what: $(root journalctl --no-pager --lines 30)"
        sleep 1
    done
}
is() { root systemctl show --property "$2" "paddock-$1" | grep -qx "$2=$3"; } # PROGRAM PROPERTY VALUE

wait_for 60 booted root systemctl is-system-running --wait
sed -n '/^## systemd$/,/^## /p' docs/operators.md | sed -n '/^```sh$/,/^```$/{/^```/!p}' |
    sed "s|https://git.example.org/paddock.git|/srv/paddock.git|; s|manage.py setup|& --no-input|; s|manage.py units|& --port ${address##*:}|" >"$system/srv/steps.sh"
root sh -eux /srv/steps.sh
until_ready $address root journalctl --no-pager --lines 30
race $address $address
inside python manage.py shell --verbosity 0 -c "
from evaluation.models import WorkerNode
for worker in WorkerNode.objects.exclude(sandbox={}):
    print(worker.name, 'sandbox', worker.sandbox['level'], 'golden runs', worker.proof['equal'], 'of', worker.proof['runs'])"

for program in broker web streams worker trainer video-worker messenger; do
    root systemctl kill --signal=KILL --kill-who=main paddock-$program
    wait_for 60 "started again: $program" is $program NRestarts 1
    wait_for 60 "active: $program" is $program SubState running
done
until_ready $address root journalctl --no-pager --lines 30
echo "Killed, and started again: all programs"

inside python manage.py workers --drain all >/dev/null
wait_for 60 "ended by draining" is worker ActiveState inactive
inside python manage.py workers --resume all >/dev/null
root systemctl start paddock.target
root systemctl restart paddock.target
root systemctl reload paddock-web
root systemctl start paddock-backup
until_ready $address root journalctl --no-pager --lines 30
root systemctl --no-pager --failed --quiet | grep . && fail "units have failed"
root systemctl --no-pager list-units 'paddock*'
root sh -c 'ls -l /var/backups/paddock'
