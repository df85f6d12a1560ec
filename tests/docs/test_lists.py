"""Lists that are written by hand beside another have an entry for each of its members."""

from __future__ import annotations

from django.conf import settings

from core.jobs.kinds import all_kinds
from evaluation.templatetags.garage import SENSOR_WORDS
from league.history.form import TIMING_METHODS
from league.models import NoticeKind
from league.notices import SENTENCES
from paddock.packages.inputs import SENSOR_NAMES
from paddock.rules.race import RANKING_METHODS
from races.ranking import RULES


def test_every_notice_has_a_sentence():
    assert set(SENTENCES) == set(NoticeKind)


def test_every_sensor_has_a_label():
    assert set(SENSOR_WORDS) == set(SENSOR_NAMES)


def test_every_ranking_method_has_a_rule_and_a_name_in_records():
    assert set(RULES) == set(TIMING_METHODS.values()) == set(RANKING_METHODS)


def test_celery_beat_sends_the_tasks_of_every_kind_of_job():
    """A wake-up may be lost: the sweep of a kind stands beside its task, and Beat sends it."""
    sent = {entry["task"] for entry in settings.CELERY_BEAT_SCHEDULE.values()}
    rooms = {task.rpartition(".")[0] for task in sent}
    assert {kind.task.rpartition(".")[0] for kind in all_kinds()} <= rooms
