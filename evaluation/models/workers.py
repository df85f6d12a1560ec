"""The table of workers, for the page of the operators."""

from django.db import models
from django.utils.translation import gettext_lazy as _


class WorkerNode(models.Model):
    """A worker that was seen, for the operators' page. Not a lock.

    ``seen_at``: its last heartbeat, in the database's time; ``queues``: what it listens to; ``processes``: jobs at
    once; ``stopped_at``: of a clean shutdown. ``sandbox``: of :class:`evaluation.sandbox.probe.SandboxReport`.
    ``proof``: of :class:`evaluation.running.proof.Proof`, and ``allowed``, whether it works though it is not exact.
    Both are empty for a worker that runs no submitted code, and before it first looks for work.
    """

    name = models.CharField(_("name"), max_length=128, unique=True)
    seen_at = models.DateTimeField(_("last seen"), db_index=True)
    started_at = models.DateTimeField(_("started"), null=True, blank=True)
    stopped_at = models.DateTimeField(_("shut down"), null=True, blank=True)
    queues = models.JSONField(_("queues"), default=list, blank=True)
    processes = models.PositiveSmallIntegerField(_("processes"), default=1)
    sandbox = models.JSONField(_("sandbox"), default=dict, blank=True)
    proof = models.JSONField(_("golden runs"), default=dict, blank=True)
    engine = models.CharField(_("engine"), max_length=32, blank=True)
    cpu_model = models.CharField(_("processor"), max_length=128, blank=True, default="", db_default="")

    class Meta:
        verbose_name = _("worker")
        verbose_name_plural = _("workers")
        ordering = ["-seen_at"]

    def __str__(self) -> str:
        return self.name

    @property
    def refuses(self) -> bool:
        """Whether it takes no work: its sandbox is not good enough, or its golden runs differ."""
        if not self.sandbox.get("sufficient", True):
            return True
        return not (self.proof.get("exact", True) or self.proof.get("allowed", False))
