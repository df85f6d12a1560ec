"""Looks round before its lock, while it is imported, and reports after it."""

import os

from evaluation.sandbox.frames import write_message

# Tens of thousands of files that every user of a host may read.
_LIBRARIES = (
    *("/usr/lib", "/usr/lib32", "/usr/lib64", "/lib", "/lib32", "/lib64", "/sys"),
    os.path.dirname(os.__file__),
)


def _visible():
    found = []
    for directory, directories, files in os.walk("/"):
        if directory in _LIBRARIES or os.path.basename(directory) in ("site-packages", "dist-packages"):
            directories.clear()
        else:
            found += [os.path.join(directory, name) for name in files]
    return found


def _writable():
    places = ["/", "/tmp", "/dev/shm", "/proc", os.path.dirname(__file__), os.path.dirname(os.__file__)]
    done = []
    for place in places:
        path = os.path.join(place, "paddock-escape")
        try:
            os.close(os.open(path, os.O_WRONLY | os.O_CREAT))
        except OSError:
            continue
        os.unlink(path)
        done.append(place)
    return done


VISIBLE, WRITABLE = _visible(), _writable()
NETWORK = os.path.exists("/sys/class/net")


def main(_frames_in, frames_out):
    write_message(frames_out, {"visible": VISIBLE, "writable": WRITABLE, "network": NETWORK, "pid": os.getpid()})
