#!/bin/sh
# Tries Paddock in a new Debian or Ubuntu, which debootstrap makes.
#   sudo scripts/try-system.sh [OPTION]... SYSTEM STEP
#
# SYSTEM: bookworm (Debian 12), trixie (Debian 13), noble (Ubuntu 24.04) or another that debootstrap knows
# STEP:
#   start      "make setup", then "make run" until the site answers, twice: the time of each, the memory at rest
#   test       "make test"
#   journey    cars are uploaded in a browser, raced and ranked
#   golden     the golden runs
#   COMMAND    any command with its arguments, in the copy of the checkout: "bash", for example
# OPTION:
#   --user                 as an ordinary user; root types what make asks for
#   --offline              without a network
#   --again                in the system that the last try left behind, not in a new one
#   --checkout NAME        folder for the copy of this checkout (default: paddock); with --again, a second checkout
#   --env NAME[=VALUE]     a variable for the step
#   --bind FROM[:TO]       a file or folder of this machine to see, at the same path or at TO
#   --rest SECONDS         memory is measured once a site has printed nothing for so long (default: 30)
#   --roots FOLDER         where the systems lie (default: /var/tmp/paddock-systems)
#   --keys FILE            the keys of Ubuntu's archive (default: those of the package ubuntu-keyring)
#
# It needs root, debootstrap and util-linux; --offline needs iproute2, too.
set -eu
umask 022 # an ordinary user reads the system that root makes

usage() { sed -n '2,/^set/s/^# \{0,1\}//p' "$0"; }
fail() {
    echo "try-system.sh: $1" >&2
    exit "${2:-1}"
}

main() {
    user=root network=yes again=no checkout=paddock variables="" binds=""
    rest=30 roots=/var/tmp/paddock-systems keys=/usr/share/keyrings/ubuntu-archive-keyring.gpg
    while :; do
        case "${1:-}" in
            --help | -h) usage && exit ;;
            --user) user=racer ;;
            --offline) network=no ;;
            --again) again=yes ;;
            --checkout | --env | --bind | --rest | --roots | --keys)
                [ $# -gt 1 ] || fail "$1 needs a value" 2
                take "$1" "$2"
                shift
                ;;
            -*) fail "there is no option $1; --help lists all" 2 ;;
            *) break ;;
        esac
        shift
    done
    [ $# -gt 1 ] || fail "name a system and a step; --help explains both" 2
    case "$1$checkout" in
        *[!a-z0-9-]*) fail "the name of a system or a checkout has only lower-case letters, digits and hyphens" 2 ;;
    esac
    case "$rest" in
        "" | *[!0-9]*) fail "--rest $rest: not a number of seconds" 2 ;;
    esac
    [ "$(id -u)" -eq 0 ] || fail "only root can make a system and enter it"
    for program in debootstrap unshare pivot_root; do
        command -v $program >/dev/null || fail "$program is missing: install debootstrap and util-linux"
    done
    [ $network = yes ] || command -v ip >/dev/null || fail "ip is missing: install iproute2"

    pristine=$roots/$1 root=$roots/$1.try home=/root alone=""
    [ "$user" = root ] || home=/home/$user
    [ $network = yes ] || alone=--net
    make_system "$1"
    copy_checkout
    shift
    export root home user network checkout rest variables binds
    exec unshare --mount --pid --ipc $alone --fork --kill-child -- sh "$0" --inside "$@"
}

take() { # OPTION VALUE
    case "$1" in
        --checkout) checkout=$2 ;;
        --rest) rest=$2 ;;
        --roots) roots=$2 ;;
        --keys) keys=$2 ;;
        --bind)
            [ -e "${2%%:*}" ] || fail "--bind ${2%%:*}: no such file or folder" 2
            binds="$binds$2
"
            ;;
        --env)
            case "$2" in
                *=*) variable=$2 ;;
                *) variable=$2=$(printenv "$2") || fail "--env $2: no such variable" 2 ;;
            esac
            variables="$variables$variable
"
            ;;
    esac
}

make_system() { # SYSTEM: a pristine one, kept for every later try, and a copy for this one
    if [ ! -d "$pristine" ]; then
        set -- "$1" "$pristine.new"
        case "$1" in
            bookworm | trixie | forky | sid) ;;
            *) # Ubuntu: debootstrap's script for all of them is the first one's
                [ -e "$keys" ] || fail "$keys is missing: install ubuntu-keyring, or name the keys of Ubuntu with --keys"
                set -- --keyring="$keys" --components=main,universe "$@" http://archive.ubuntu.com/ubuntu gutsy
                ;;
        esac
        echo "Making $pristine"
        mkdir -p "$roots"
        rm -rf "$pristine.new"
        debootstrap --variant=minbase --include=make,ca-certificates "$@" >"$pristine.log" ||
            fail "debootstrap failed: $(tail -n 3 "$pristine.log")"
        mv "$pristine.new" "$pristine"
    fi
    if [ $again = no ]; then
        rm -rf --one-file-system "$root"
        cp -a --reflink=auto "$pristine" "$root"
    fi
    [ -d "$root" ] || fail "$root is missing: the first try is without --again"
    grep -q "^$user:" "$root/etc/passwd" || chroot "$root" useradd --create-home --shell /bin/bash $user
}

copy_checkout() { # with what is not committed, without what git ignores; once there, it stays as the last try left it
    [ ! -d "$root$home/$checkout" ] || return 0
    mkdir "$root$home/$checkout"
    from=$(dirname "$0")/..
    sed 's|^/|./|; s|/$||' "$from/.gitignore" | tar -C "$from" --exclude=./.git --exclude-from=- -c . |
        tar -C "$root$home/$checkout" -x --no-same-owner
    owner=$(sed -n "s/^$user:[^:]*:\([0-9]*:[0-9]*\):.*/\1/p" "$root/etc/passwd")
    chown -R "$owner" "$root$home/$checkout"
}

enter() { # a plain chroot would not do: the kernel refuses user namespaces in one, and the sandbox needs them
    mount --bind "$root" "$root"
    mount -t proc proc "$root/proc"
    mount --rbind /sys "$root/sys"
    mount --rbind /dev "$root/dev"
    for folder in dev/shm tmp run; do mount -t tmpfs -o mode=1777 tmpfs "$root/$folder"; done
    if [ "$network" = yes ]; then cp --remove-destination /etc/resolv.conf "$root/etc"; else ip link set lo up; fi
    printf %s "$binds" | while IFS=: read -r from to; do
        to=$root${to:-$from}
        mkdir -p "$(dirname "$to")"
        [ -e "$to" ] || if [ -d "$from" ]; then mkdir "$to"; else : >"$to"; fi
        mount --bind "$from" "$to"
        mount -o remount,ro,bind "$to"
    done
    cd "$root"
    pivot_root . mnt
    umount --lazy /mnt
    cd "$home/$checkout"
    log=/run/try.log
}

as_user() { # COMMAND...: in the environment of a log-in; what a shell begins beside itself would ignore Ctrl-C
    [ "$user" = root ] || set -- setpriv --reuid="$user" --regid="$user" --init-groups "$@"
    while read -r variable; do
        [ -z "$variable" ] || set -- "$variable" "$@"
    done <<END
$variables
END
    path=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
    exec env -i --default-signal=INT,QUIT HOME="$home" USER="$user" LANG=C.UTF-8 TERM="${TERM:-dumb}" PATH=$path "$@"
}

begin() { # COMMAND...: beside us, with what it prints in the log and on the terminal
    : >$log
    (as_user "$@") >$log 2>&1 &
    process=$!
    tail -f -n +1 -s 0.1 --pid=$process $log &
    tail=$!
}

end() { # its exit status
    status=0
    wait $process || status=$?
    wait $tail # it reads the last lines, and ends
    return $status
}

typed=""
ask_root() { # whether the log asks for something new, which is then done
    before=$typed
    typed=$(sed -n 's/^ *sudo /sudo /p' $log)
    [ "$user" != root ] && [ -n "$typed" ] && [ "$typed" != "$before" ] || return 1
    echo "root types: $typed"
    DEBIAN_FRONTEND=noninteractive sh -c "sudo() { \"\$@\"; }; $typed" >$log 2>&1 || fail "$(cat $log)"
}

step() { # COMMAND...: again where it asks for something
    begin "$@"
    end || { ask_root && step "$@"; }
}

start() { # NAME
    begun=$(date +%s%N)
    begin make run
    until grep -q "Paddock is ready" $log; do
        ! grep -q "^State:.Z" /proc/$process/status || fail "make run ended"
        sleep 0.1
    done
    ready=$(milliseconds)
    until [ $(($(date +%s) - $(stat -c %Y $log))) -gt "$rest" ]; do sleep 1; done
    measured=$(memory)
    kill -TERM $process
    end || true
    echo "$1 start: $ready ms until the site answers, $measured at rest"
}

milliseconds() { # since $begun
    echo $((($(date +%s%N) - begun) / 1000000))
}

setup() {
    begun=$(date +%s%N)
    step make setup || return
    echo "Setup: $(milliseconds) ms"
}

memory() { # of all processes but ours
    for one in /proc/[0-9]*; do
        case $(cat "$one/comm") in
            sh | make | tail | awk | try-system.sh) ;;
            *) cat "$one/smaps_rollup" ;;
        esac
    done 2>/dev/null | awk '/^Pss:/ {sum += $2; count++} END {printf "%d MB (PSS of %d processes)", sum / 1024, count}'
}

inside() { # STEP
    enter
    case "$1" in
        start) setup && start First && start Second ;;
        test) step make test ;;
        journey) step make journeys PYTEST_ARGS="tests/pages/test_browser.py -k upload" ;;
        golden) step sh -c "make setup && .venv/bin/python -m training.golden" ;;
        *) (as_user "$@") ;;
    esac
}

case "${1:-}" in
    --inside) shift && inside "$@" ;;
    *) main "$@" ;;
esac
exit
