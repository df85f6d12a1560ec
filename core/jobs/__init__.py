"""The leased queue: jobs are rows, workers claim them with a lease, messages only wake workers.

A new kind: a model that inherits :class:`core.jobs.models.Job` (or ``Leased``) with ``*lease_constraints(...)``; a
registered subclass of :class:`core.jobs.retried.RetriedKind` (or ``JobKind``); a task that calls
:func:`core.jobs.work.work_off`, and one for Beat that calls ``sweep``; an entry in ``CELERY_BEAT_SCHEDULE``, in
docs/architecture.md and in ``MAKERS`` of tests/core/jobs/kinds.py; for its own queue a worker in
``config/operations/run.py`` and docs/operators.md.

Every write is a guarded UPDATE that names the lease; time is the database's; a platform fault is retried after growing
pauses; while a needed part is out, no job is claimed, and none by a worker that is held (:mod:`.holds`); tasks are
called by name."""

DRAINED_STATUS = 75  # the exit status of a drained worker (:mod:`.holds`): it is left alone until it is resumed
