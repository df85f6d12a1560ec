"""The queue of runs: order, turns, leases, and the worker that takes the next run."""
