"""Runs: their queue, the sandboxed processes that drive them, and their results."""
