"""Everything a process in the sandbox must not be able to do, as Python code that tries.

``main`` runs in the sandbox, as if the model's runtime had been taken over; ``try_all`` can also run outside, to show
that the attempts are sound.
"""

import ctypes
import mmap
import os
import resource
import signal
import socket
import threading

from evaluation.sandbox.frames import read_message, write_message

_libc = ctypes.CDLL(None, use_errno=True)
_NUMBERS = {
    "x86_64": {
        "vfork": 58, "clone": 56, "clone3": 435, "execveat": 322, "io_uring_setup": 425, "bpf": 321, "keyctl": 250,
        "add_key": 248, "perf_event_open": 298, "userfaultfd": 323, "pidfd_open": 434, "pidfd_send_signal": 424,
        "tgkill": 234, "open_by_handle_at": 304, "pivot_root": 155, "kexec_load": 246, "init_module": 175,
        "memfd_secret": 447, "landlock_create_ruleset": 444, "process_madvise": 440, "open_tree": 428, "fsopen": 430,
    },
    "aarch64": {
        "clone": 220, "clone3": 435, "execveat": 281, "io_uring_setup": 425, "bpf": 280, "keyctl": 219,
        "add_key": 217, "perf_event_open": 241, "userfaultfd": 282, "pidfd_open": 434, "pidfd_send_signal": 424,
        "tgkill": 131, "open_by_handle_at": 265, "pivot_root": 41, "kexec_load": 104, "init_module": 105,
        "memfd_secret": 447, "landlock_create_ruleset": 444, "process_madvise": 440, "open_tree": 428, "fsopen": 430,
    },
}  # fmt: skip
_CALLS = _NUMBERS.get(os.uname().machine, {})
_NEWNS, _NEWUSER, _NEWPID = 0x20000, 0x10000000, 0x20000000


def _checked(result):
    if result < 0:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))
    return result


def _syscall(name, *arguments):
    return _checked(_libc.syscall(ctypes.c_long(_CALLS[name]), *arguments))


def _child(pid):
    if pid == 0:
        os._exit(0)
    os.waitpid(pid, 0)


def _fork_and_detach():
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            os._exit(0)
        os._exit(0)


def _thread_bomb():
    for _ in range(50):
        threading.Thread(target=lambda: None).start()


def _write(path):
    os.close(os.open(path, os.O_WRONLY | os.O_CREAT, 0o600))
    os.unlink(path)


def _read(path):
    with open(path, "rb") as file:
        file.read(1)


def _many_descriptors():
    held = []
    try:
        for _ in range(10_000):
            held.append(os.dup(2))
    finally:
        for fd in held:
            os.close(fd)


def _executable_memory():
    mmap.mmap(-1, 4096, prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC).close()


def _make_memory_executable():
    memory = mmap.mmap(-1, 4096, prot=mmap.PROT_READ | mmap.PROT_WRITE)
    address = ctypes.addressof(ctypes.c_char.from_buffer(memory))
    _checked(_libc.mprotect(ctypes.c_void_p(address), ctypes.c_size_t(4096), 5))


def _peek_at_parent():
    buffer = ctypes.create_string_buffer(8)
    local = (ctypes.c_void_p * 2)(ctypes.addressof(buffer), 8)
    remote = (ctypes.c_void_p * 2)(0x400000, 8)
    _checked(_libc.process_vm_readv(os.getppid(), local, 1, remote, 1, 0))


def _more_limit():
    resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))


def _import_late():
    import wave  # noqa: F401


def attempts(paths):
    """name -> what to try. ``paths``: ``database``, ``media``, ``directory``, files and a directory of the host."""
    database, media, directory = paths["database"], paths["media"], paths["directory"]
    parent = os.getppid()
    tries = {
        # reading
        "read the password file": lambda: _read("/etc/passwd"),
        "read the database": lambda: _read(database),
        "read another racer's upload": lambda: _read(media),
        "list the media folder": lambda: os.listdir(directory),
        "see whether the database exists": lambda: os.stat(database),
        "list the root directory": lambda: os.listdir("/"),
        "read the first process's environment": lambda: _read("/proc/1/environ"),
        "read its own environment again": lambda: _read("/proc/self/environ"),
        "read the parent's memory file": lambda: _read(f"/proc/{parent}/mem"),
        "list processes": lambda: os.listdir("/proc"),
        "import another module": _import_late,
        # writing
        "write to /tmp": lambda: _write("/tmp/paddock-escape"),
        "write to the working directory": lambda: _write("paddock-escape"),
        "write to shared memory": lambda: _write("/dev/shm/paddock-escape"),
        "write beside the database": lambda: _write(f"{directory}/paddock-escape"),
        "write over the database": lambda: os.close(os.open(database, os.O_WRONLY)),
        "truncate the database": lambda: os.truncate(database, 0),
        "remove the database": lambda: os.unlink(database),
        "make a directory": lambda: os.mkdir("/tmp/paddock-escape-directory"),
        "make a link to the database": lambda: os.symlink(database, "/tmp/paddock-escape-link"),
        "make a named pipe": lambda: os.mkfifo("/tmp/paddock-escape-fifo"),
        "change the database's mode": lambda: os.chmod(database, 0o666),
        # talking
        "open a TCP socket": lambda: socket.socket(socket.AF_INET, socket.SOCK_STREAM).close(),
        "open a TCP socket over IPv6": lambda: socket.socket(socket.AF_INET6, socket.SOCK_STREAM).close(),
        "open a UDP socket": lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM).close(),
        "open a unix socket": lambda: socket.socket(socket.AF_UNIX, socket.SOCK_STREAM).close(),
        "open a pair of sockets": lambda: [end.close() for end in socket.socketpair()],
        "open a netlink socket": lambda: socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0).close(),
        "open a vsock socket": lambda: socket.socket(socket.AF_VSOCK, socket.SOCK_STREAM).close(),
        "open a raw socket": lambda: socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_ICMP).close(),
        "make a pipe": lambda: [os.close(fd) for fd in os.pipe()],
        # multiplying
        "fork": lambda: _child(os.fork()),
        "fork twice and detach": _fork_and_detach,
        "spawn a program": lambda: _child(os.posix_spawn("/usr/bin/env", ["env", "true"], {})),
        "clone": lambda: _child(_syscall("clone", signal.SIGCHLD, None, None, None, None)),
        "clone3": lambda: _child(
            _syscall("clone3", (ctypes.c_uint64 * 8)(0, 0, 0, 0, signal.SIGCHLD, 0, 0, 0), ctypes.c_size_t(64))
        ),
        "start threads": _thread_bomb,
        # executing
        "execute a shell": lambda: os.execv("/bin/sh", ["sh", "-c", "exit"]),
        "make a file in memory": lambda: os.close(os.memfd_create("payload")),
        "execute a file in memory": lambda: _syscall("execveat", 2, b"", None, None, 0x1000),
        "map executable memory": _executable_memory,
        "make memory executable": _make_memory_executable,
        # signalling
        "ask whether the parent lives": lambda: os.kill(parent, 0),
        "stop the parent": lambda: os.kill(parent, signal.SIGSTOP),
        "kill everybody": lambda: os.kill(-1, signal.SIGCONT),
        "signal a thread of the parent": lambda: _syscall("tgkill", parent, parent, 0),
        "open the parent as a descriptor": lambda: os.close(_syscall("pidfd_open", parent or 1, 0)),
        "signal through a descriptor": lambda: _syscall("pidfd_send_signal", 2, 0, None, 0),
        # spying
        "trace the parent": lambda: _checked(_libc.ptrace(16, parent, None, None)),
        "be traced": lambda: _checked(_libc.ptrace(0, 0, None, None)),
        "read the parent's memory": _peek_at_parent,
        # privileges and namespaces
        "become root": lambda: _checked(_libc.setuid(0)),
        "change groups": lambda: os.setgroups([0]),
        "enter a new user namespace": lambda: _checked(_libc.unshare(_NEWUSER)),
        "enter a new mount namespace": lambda: _checked(_libc.unshare(_NEWNS)),
        "enter a given namespace": lambda: _checked(_libc.setns(2, 0)),
        "mount": lambda: _checked(_libc.mount(b"none", b"/tmp", b"tmpfs", 0, None)),
        "unmount": lambda: _checked(_libc.umount2(b"/", 2)),
        "change the root": lambda: os.chroot("/"),
        "pivot the root": lambda: _syscall("pivot_root", b"/", b"/"),
        "open a tree": lambda: _syscall("open_tree", -100, b"/", 0),
        "open a file system": lambda: _syscall("fsopen", b"tmpfs", 0),
        "open by handle": lambda: _syscall("open_by_handle_at", 2, None, 0),
        "change the personality": lambda: _checked(_libc.personality(0x0040000)),
        # the kernel's odd corners
        "set up io_uring": lambda: _syscall("io_uring_setup", 1, ctypes.create_string_buffer(120)),
        "load a bpf program": lambda: _syscall("bpf", 0, ctypes.create_string_buffer(128), 128),
        "use the key ring": lambda: _syscall("keyctl", 0, -3, 0, 0, 0),
        "add a key": lambda: _syscall("add_key", b"user", b"a", b"b", 1, -3),
        "open a performance counter": lambda: _syscall(
            "perf_event_open", ctypes.create_string_buffer(128), 0, -1, -1, 0
        ),
        "handle page faults": lambda: _syscall("userfaultfd", 1),
        "make secret memory": lambda: _syscall("memfd_secret", 0),
        "load a kernel": lambda: _syscall("kexec_load", 0, 0, None, 0),
        "load a module": lambda: _syscall("init_module", None, 0, b""),
        "make another Landlock ruleset": lambda: _syscall("landlock_create_ruleset", None, 0, 1),
        "make shared memory": lambda: _checked(_libc.shmget(0, 4096, 0o1600)),
        "control the terminal": lambda: _checked(_libc.ioctl(2, 0x5412, b"x")),
        # limits
        "raise its own limits": _more_limit,
        "change its parent's limits": lambda: resource.prlimit(parent or 1, resource.RLIMIT_NOFILE, (10, 10)),
        "hold ten thousand descriptors": _many_descriptors,
        "choose its processor": lambda: os.sched_setaffinity(0, {0}),
    }
    if "vfork" in _CALLS:
        # Last and on its own: a vfork that works would run the rest on the parent's stack.
        tries["vfork"] = lambda: _child(_syscall("vfork"))
    return tries


def try_all(paths, names=None):
    """``{name: "open" or what refused it}``."""
    outcomes = {}
    for name, attempt in attempts(paths).items():
        if names is not None and name not in names:
            continue
        try:
            attempt()
        except OSError as error:
            outcomes[name] = os.strerror(error.errno) if error.errno else str(error)
        except (RuntimeError, ImportError, ValueError) as error:
            outcomes[name] = f"{type(error).__name__}: {error}"
        else:
            outcomes[name] = "open"
    return outcomes


def main(frames_in, frames_out):
    message, _ = read_message(frames_in)
    write_message(frames_out, {"outcomes": try_all(message["paths"])})
