"""Runs the command as ``python -m paddock.cli`` where its script is not installed."""

from .pinned import get_ready

if __name__ == "__main__":
    get_ready()
    from .main import program

    program()
