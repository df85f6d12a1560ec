"""Training jobs: the queue, the run in a worker, their pages and API."""
