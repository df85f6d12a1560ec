"""``makemigrations`` without migrations for texts, see :mod:`core.migration_detector`."""

from django.core.management.commands.makemigrations import Command as DjangoCommand

from core.migration_detector import TextBlindAutodetector


class Command(DjangoCommand):
    autodetector = TextBlindAutodetector
