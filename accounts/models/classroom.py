"""Classes: a teacher's learners, with accounts without e-mail address and password."""

from django.conf import settings
from django.db import models
from django.urls import reverse
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField

from .group import RacerGroup


class Classroom(models.Model):
    """A class: a group that is never listed, whose leader is the teacher. ``plan``: slugs of lessons, in order."""

    group = models.OneToOneField(RacerGroup, models.PROTECT, related_name="classroom", verbose_name=_("group"))
    plan = models.JSONField(_("lesson plan"), default=list, blank=True)
    made_at = models.DateTimeField(_("created"))

    class Meta:
        verbose_name = _("class")
        verbose_name_plural = _("classes")
        ordering = ["-made_at", "-pk"]

    def __str__(self) -> str:
        return str(self.group)

    def get_absolute_url(self) -> str:
        return reverse("classroom", args=[self.group.slug])


class ClassTeacher(models.Model):
    """A second teacher of a class, with the first teacher's rights except deleting it and choosing teachers."""

    classroom = models.ForeignKey(Classroom, models.CASCADE, related_name="teachers", verbose_name=_("class"))
    racer = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="classes_taught", verbose_name=_("racer")
    )
    added_at = models.DateTimeField(_("added"))

    class Meta:
        verbose_name = _("second teacher of a class")
        verbose_name_plural = _("second teachers of classes")
        ordering = ["pk"]
        constraints = [models.UniqueConstraint(fields=["classroom", "racer"], name="class_teacher_once")]

    def __str__(self) -> str:
        return f"{self.classroom}: {self.racer}"


class ClassLearner(models.Model):
    """An account in a class. The real name and ``student_id``, the learner's name in a school's system, are the
    teacher's to see; of the code that logs in only a digest is kept."""

    racer = models.OneToOneField(
        settings.AUTH_USER_MODEL, models.CASCADE, primary_key=True, related_name="learner", verbose_name=_("racer")
    )
    classroom = models.ForeignKey(Classroom, models.CASCADE, related_name="learners", verbose_name=_("class"))
    real_name = OneLineField(_("name"), max_length=80)
    student_id = OneLineField(_("student ID"), max_length=80, blank=True, default="", db_default="")
    code_digest = models.CharField(max_length=64, unique=True, null=True, editable=False)
    lessons = models.JSONField(_("lessons seen"), default=dict, blank=True)

    class Meta:
        verbose_name = _("learner")
        verbose_name_plural = _("learners")
        ordering = ["real_name", "pk"]
        constraints = [
            models.UniqueConstraint(
                fields=["classroom", "student_id"],
                condition=~models.Q(student_id=""),
                name="class_learner_student_id_once",
            )
        ]

    def __str__(self) -> str:
        return str(self.racer_id)
