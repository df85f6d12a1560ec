#!/bin/sh
# Builds the container images without any registry, prints their sizes, and drives and trains cars in them.
#   sudo scripts/try_images.sh [--place FOLDER] [TARGET]...
#
# TARGET: site, worker, trainer, video, embedded (all of them unless some are named). Their base is a Debian 12 that
# debootstrap makes. In the embedded one, on a read-only root without any capability, a car is driven, one trained and a
# video drawn. Where podman-compose is installed (1.1 or newer), all of compose.yaml is started and does the same, on
# ports 80 and 443, with Debian's PostgreSQL, Redis and Caddy and moto's S3 server in the place of the images that a
# registry would have.
# FOLDER holds base and images (default: /var/tmp/paddock-images). pip looks where it is configured to look here, also
# in a folder of wheels (PIP_FIND_LINKS).
#
# It needs root, debootstrap, buildah and podman. Where podman may not set limits or finds cgroups in hybrid mode, as in a
# virtual machine without systemd, containers run without cgroups.
set -eu

cd "$(dirname "$0")/.."
. scripts/try_race.sh
place=/var/tmp/paddock-images port=8199 name=paddock-try
fail() {
    echo "try_images.sh: $1" >&2
    exit "${2:-1}"
}
while :; do
    case "${1:-}" in
        --help | -h) sed -n '2,/^set/s/^# \{0,1\}//p' "$0" && exit ;;
        --place) place=${2:?} && shift 2 ;;
        -*) fail "there is no option $1; --help lists all" 2 ;;
        *) break ;;
    esac
done
[ $# -gt 0 ] || set -- site worker trainer video embedded
[ "$(id -u)" -eq 0 ] || fail "only root can make a base and build on it"
for program in debootstrap buildah podman; do
    command -v $program >/dev/null || fail "$program is missing: apt-get install debootstrap buildah podman"
done

mkdir -p "$place"
printf '[storage]\ndriver = "overlay"\ngraphroot = "%s/images"\nrunroot = "%s/run"\n' "$place" "$place" >"$place/storage.conf"
export CONTAINERS_STORAGE_CONF="$place/storage.conf" BUILDAH_ISOLATION=chroot

base() {
    ! podman image exists localhost/paddock-base || return 0
    rm -rf "$place/base"
    debootstrap --variant=minbase --include=ca-certificates bookworm "$place/base" >"$place/base.log" || fail "$(tail -n 3 "$place/base.log")"
    rm -rf "$place"/base/var/cache/apt/archives/*.deb "$place"/base/var/lib/apt/lists/*
    cp /etc/ssl/certs/ca-certificates.crt "$place/base/etc/ssl/certs/" # of a proxy that this machine trusts
    tar -C "$place/base" -c . | podman import --quiet - localhost/paddock-base >/dev/null
    rm -rf "$place/base"
}

build() { # TARGET
    wheels=$(python3 -m pip config get env.find-links 2>/dev/null || echo "${PIP_FIND_LINKS:-}")
    [ -d "$wheels" ] || wheels=$place
    echo "Building $1"
    buildah build --format docker --layers --quiet --volume "$wheels:$wheels:ro" --build-arg "PIP_FIND_LINKS=$wheels" \
        --build-arg BASE=localhost/paddock-base --target "$1" --tag "localhost/paddock-$1" . >"$place/$1.log" 2>&1 ||
        fail "building $1 failed: $(tail -n 20 "$place/$1.log")"
}

# podman, and where it cannot manage resources, the same without cgroups, in a mount namespace that has the new ones only
run() {
    # shellcheck disable=SC2086
    podman run $limits "$@"
}
choose_limits() { # TARGET...
    limits=""
    ! run --rm localhost/paddock-base true 2>"$place/run.log" || return 0
    limits="--cgroups=disabled --ulimit=nofile=4096:4096 --ulimit=nproc=4096:4096"
    ! run --rm localhost/paddock-base true 2>>"$place/run.log" || return 0
    [ -z "${PADDOCK_TRY_AGAIN:-}" ] || fail "podman cannot run containers here: $(cat "$place/run.log")"
    echo "podman runs containers without cgroups here: $(head -n 1 "$place/run.log")"
    # shellcheck disable=SC2016
    PADDOCK_TRY_AGAIN=1 exec unshare --mount sh -c 'umount -R /sys/fs/cgroup && mount -t cgroup2 cgroup2 /sys/fs/cgroup && exec "$@"' \
        - "$0" --place "$place" "$@"
}

embedded() { # on a read-only root, without capabilities
    stop() { podman rm --force --time 5 $name >/dev/null 2>&1 && podman volume rm $name >/dev/null 2>&1 || true; }
    stop
    run --detach --name $name --read-only --tmpfs /tmp --cap-drop ALL --security-opt no-new-privileges \
        --volume $name:/data --publish 127.0.0.1:$port:8000 localhost/paddock-embedded >/dev/null
    trap stop EXIT
    until_ready http://127.0.0.1:$port podman logs $name
    podman healthcheck run $name
    inside() { podman exec $name "$@"; }
    race http://127.0.0.1:$port http://127.0.0.1:8000
    stop
}

compose() { # the site of compose.yaml in a folder of its own, with stand-ins of its services
    site=$place/site
    rm -rf "$site"
    mkdir "$site"
    cp -r compose.yaml containers "$site"
    (umask 077 && {
        echo SITE_HOST=localhost
        for secret in PADDOCK_SECRET_KEY POSTGRES_PASSWORD VALKEY_PASSWORD S3_SECRET_KEY; do echo "$secret=$(openssl rand -hex 24)"; done
        for service in postgres valkey s3 caddy; do echo "$service" | tr a-z A-Z | sed "s|\$|_IMAGE=localhost/standin-$service|"; done
    } >"$site/.env")
    for service in postgres valkey s3 caddy; do
        buildah build --layers --quiet --build-arg BASE=localhost/paddock-base --file tests/config/standins.Containerfile \
            --target $service --tag localhost/standin-$service containers >"$place/$service.log" 2>&1 || fail "$(tail "$place/$service.log")"
    done
    composed() { (cd "$site" && podman-compose --podman-run-args="$limits" "$@"); }
    stop() { # the second worker, too, of which podman-compose knows at its start alone
        podman ps --all --quiet --filter label=io.podman.compose.project=paddock | xargs --no-run-if-empty podman rm --force --volumes --time 5 >/dev/null 2>&1
        composed down --volumes >/dev/null 2>&1 || true
    }
    stop
    trap stop EXIT
    # one after the other: Podman 4.3 knows neither healthy dependencies nor those of dependencies
    composed up --detach --no-build --no-deps postgres valkey s3 setup
    until [ "$(podman inspect --format '{{.State.Running}} {{.State.ExitCode}}' paddock_setup_1)" = "false 0" ]; do sleep 2; done
    composed up --detach --no-build --no-deps --scale worker=2 site streams messenger worker trainer video caddy
    until_ready https://localhost composed logs
    podman ps --format '{{.Names}} {{.Status}}'
    inside() { podman exec paddock_site_1 "$@"; }
    race https://localhost http://127.0.0.1:8000
}

levels() { # what the sandbox comes to under a runtime's options
    for options in "" "--security-opt=seccomp=containers/seccomp.json" "--security-opt=seccomp=unconfined" \
        "--user=0" "--user=0 --cap-add=SYS_ADMIN --cap-add=NET_ADMIN"; do
        # shellcheck disable=SC2086
        level=$(run --rm --read-only --tmpfs /tmp $options localhost/paddock-worker python manage.py doctor 2>&1 | grep -E '^ +(ok|fail) +level') || true
        echo "podman run $options: ${level:-it did not run}"
    done
}

base
choose_limits "$@"
for target in "$@"; do build "$target"; done
podman images --format '{{.Repository}} {{.Size}}' | grep localhost/paddock-
case " $* " in *" worker "*) levels ;; esac
case " $* " in *" embedded "*) embedded ;; esac
case " $* " in *" site worker trainer video "*) ! command -v podman-compose >/dev/null || compose ;; esac
