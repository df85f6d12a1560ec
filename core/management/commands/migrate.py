"""``migrate`` that does not report changed texts as missing migrations, see :mod:`core.migration_detector`."""

from django.core.management.commands.migrate import Command as DjangoCommand

from core.migration_detector import TextBlindAutodetector


class Command(DjangoCommand):
    autodetector = TextBlindAutodetector
