"""``makemigrations`` without migrations for texts, see :mod:`core.database.migration_detector`."""

from django.core.management.commands.makemigrations import Command as DjangoCommand

from core.database.migration_detector import TextBlindAutodetector


class Command(DjangoCommand):
    autodetector = TextBlindAutodetector
