"""Runs: their queue, the sandboxed processes that drive them, and their results."""

SCHEDULER = "scheduler"  # stands for a queue in the scheduler's row among the workers
