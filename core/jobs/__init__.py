"""The one leased queue: jobs are rows, workers claim them under a lease, a message only says that there may be work.

A new kind of job
-----------------
One file of its own, a task that Celery finds, and what stands around them:

1. A model that inherits :class:`core.jobs.models.Job` (or :class:`~core.jobs.models.Leased`, where jobs fail by no
   fault of a racer or of ours), with a ``state`` and ``*lease_constraints(...)`` among its constraints.
2. A subclass of :class:`core.jobs.retried.RetriedKind` (or :class:`core.jobs.kinds.JobKind`) that says its model, its
   states, its order, its task's name and the broker's queue; where it is its own, what follows a fault
   (:meth:`~core.jobs.retried.RetriedKind.after`) and what else happens at an end
   (:meth:`~core.jobs.retried.RetriedKind.gave_up`, :meth:`~core.jobs.kinds.JobKind.lost`). Then
   ``THINGS = register(Things())``.
3. A task that calls :func:`core.jobs.work.work_off` with a turn: :func:`core.jobs.work.run_next` and what is done in
   it. A second one, which Beat sends, calls ``THINGS.sweep(now=database_now())``.

4. Around it: the sweep in ``CELERY_BEAT_SCHEDULE``; for a queue of its own a worker that listens to it
   (``config/management/commands/run.py``) and its row in docs/operators.md; a row of docs/architecture.md; a waiting
   job in ``MAKERS`` of tests/core/jobs/kinds.py. Jobs that operators run again are registered with
   :func:`core.jobs.queues.register_queue`.

Claim, heartbeat, failure, pauses, release, sweep, stop, wake-up and the breaker come with the kind, and the contract
of tests/core/jobs holds for every kind that is registered.

Guarantees
----------
- Every write is a guarded UPDATE that names the lease and changes one row or none; no row is locked.
- Time is the database's (``now`` is passed in).
- The platform's fault is tried again after growing pauses for as long as it lasts.
- While a part that all jobs of a kind need is out (:mod:`core.jobs.outages`), none of them is claimed.
- Tasks are called by name, so that a room that queues imports no worker.
"""
