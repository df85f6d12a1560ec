"""The texts of the units, as :class:`string.Template`, and what each program needs beside its command."""

from collections.abc import Callable
from dataclasses import dataclass
from string import Template

from django.conf import settings

from config.serving.broker import MEMORY_MB
from evaluation.sandbox.limits import CONVERTER, POLICY, REWARD, RUNNER, SB3_CONVERTER, TRAINER
from paddock.rules.race import MAX_CARS

HEADER = "# Written by manage.py units; a drop-in (systemctl edit) survives the next time."
TARGET_NAME, SERVICES = "paddock.target", "multi-user.target"

PROGRAM = Template(f"""\
{HEADER}
[Unit]
Description=Paddock: $description
PartOf={TARGET_NAME}
Wants=network-online.target
After=network-online.target$after
StartLimitIntervalSec=0

[Service]
User=$user
WorkingDirectory=$checkout
EnvironmentFile=$env_file
ExecStart=$command
${{more}}Restart=always
RestartSec=5
# A drained worker stays ended: manage.py workers --resume, then systemctl start.
RestartPreventExitStatus=$drained
SuccessExitStatus=$drained
KillMode=mixed
TimeoutStopSec=30
# The sum of what its processes may take. One that the kernel ends does not stop the others.
MemoryMax=${{memory_mb}}M
OOMPolicy=continue
UMask=0077
$hardening
$confinement""")

# Settings of every program. RemoveIPC= is not among them: the units share a user, whose memory it would remove.
HARDENING = Template("""\
NoNewPrivileges=yes
CapabilityBoundingSet=
ProtectSystem=strict
ReadWritePaths=$writable
ProtectHome=$home
PrivateTmp=yes
PrivateDevices=yes
PrivateMounts=yes
ProtectClock=yes
ProtectControlGroups=yes
ProtectKernelLogs=yes
ProtectKernelModules=yes
RestrictRealtime=yes
RestrictSUIDSGID=yes
LockPersonality=yes
KeyringMode=private
SystemCallArchitectures=native
SystemCallErrorNumber=EPERM
""")

# For programs that start no sandbox.
PLAIN = Template("""\
MemoryDenyWriteExecute=yes
PrivateUsers=yes
ProtectProc=invisible
ProtectHostname=yes
ProtectKernelTunables=yes
RestrictNamespaces=yes
RestrictAddressFamilies=$families
SystemCallFilter=@system-service
SystemCallFilter=~@privileged @resources
""")

# For programs that start the sandbox: a test starts it under these settings, and under each that would break it.
SANDBOXING = Template("""\
# The sandbox puts bubblewrap, Landlock and seccomp around each stranger's process. These settings would break it or
# weaken it:
#   RestrictNamespaces       bubblewrap makes user, mount, pid, network, ipc, uts and cgroup namespaces
#   ProtectKernelTunables    bubblewrap could not forbid further user namespaces within (--disable-userns)
#   ProcSubset=pid           bubblewrap reads /proc/sys, and onnxruntime /proc/cpuinfo
#   ProtectProc=invisible    hides locked processes, whose memory and processor time are measured
#   RestrictAddressFamilies  without AF_NETLINK bubblewrap has no loopback
#   SystemCallFilter         without @mount, seccomp and landlock_* no layer closes
#   MemoryDenyWriteExecute   torch compiles kernels, where it is loaded (web, trainer)
MemoryDenyWriteExecute=$no_code
ProtectHostname=yes
RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_NETLINK
SystemCallFilter=@system-service @mount seccomp
SystemCallFilter=landlock_create_ruleset landlock_add_rule landlock_restrict_self
""")

INSTALL = Template("""
[Install]
WantedBy=$wanted_by
""")

TARGET = Template(f"""\
{HEADER}
[Unit]
Description=Paddock: all programs of this machine
Wants=$wants
After=network-online.target
""")

BACKUP = Template(f"""\
{HEADER}
[Unit]
Description=Paddock: backup
Wants=network-online.target
After=network-online.target

[Service]
Type=oneshot
User=$user
WorkingDirectory=$checkout
EnvironmentFile=$env_file
ExecStart=/bin/sh -c 'exec $python manage.py backup --verbosity 0 $backups/paddock-$$(date +%%F-%%H%%M%%S).backup'
Nice=10
IOSchedulingClass=idle
UMask=0077
$hardening
$confinement""")

TIMER = Template(f"""\
{HEADER}
[Unit]
Description=Paddock: a backup every night
PartOf={TARGET_NAME}

[Timer]
OnCalendar=*-*-* 03:00:00
RandomizedDelaySec=15min
Persistent=yes
""")


@dataclass(frozen=True)
class Needs:
    """What a program needs beside its command. ``memory_mb``: the sum of its processes; ``sandbox``: it runs
    strangers' code in the sandbox; ``torch``: it may load torch; ``local``: it speaks on unix sockets only; ``more``:
    lines of its section."""

    description: str
    memory_mb: Callable[[], int]
    sandbox: bool = False
    torch: bool = False
    local: bool = False
    more: str = ""


def _web_mb() -> int:
    converter = max(CONVERTER.address_space_mb, SB3_CONVERTER.address_space_mb)
    return 2048 + settings.UPLOADS_AT_ONCE * converter + 2 * REWARD.address_space_mb


def _worker_mb() -> int:
    return 1024 + settings.WORKER_CONCURRENCY * (MAX_CARS * POLICY.address_space_mb + RUNNER.address_space_mb)


FILES = "LimitNOFILE=65536\n"
NEEDS = {
    "broker": Needs(
        "broker",
        lambda: 4 * MEMORY_MB,
        local=True,
        more="ExecStartPre=/usr/bin/install -d -m 0700 $broker_folder\nLimitNOFILE=65536\n",
    ),
    "web": Needs(
        "pages and API", _web_mb, sandbox=True, torch=True, more="ExecReload=/bin/kill -HUP $$MAINPID\n" + FILES
    ),
    "streams": Needs("streams of open pages", lambda: 1024, more=FILES),
    "worker": Needs("evaluations", _worker_mb, sandbox=True),
    "trainer": Needs(
        "trainings",
        lambda: 1024 + settings.TRAINING_CONCURRENCY * (1024 + TRAINER.address_space_mb),
        sandbox=True,
        torch=True,
    ),
    "video-worker": Needs("videos", lambda: 2048),
    "metrics": Needs("metrics for Prometheus", lambda: 512),
    "messenger": Needs("notices, e-mails, webhooks and the scheduler", lambda: 1024),
}
