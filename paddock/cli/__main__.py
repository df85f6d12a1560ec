"""Runs the command as ``python -m paddock.cli`` where its script is not installed."""

from .main import program

if __name__ == "__main__":
    program()
