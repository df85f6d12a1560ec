"""Paddock's ``deepracer-v0`` under the module name of the original."""

from paddock.deepracer import close, export, model_metadata, running, shutdown_all

__all__ = ["close", "export", "model_metadata", "running", "shutdown_all"]
