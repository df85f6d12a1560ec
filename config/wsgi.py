"""The site as a WSGI application for config.web."""

import os

from django.core.wsgi import get_wsgi_application
from django.urls import reverse

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
application = get_wsgi_application()
from core.database.known_migrations import known_migrations  # noqa: E402  needs the apps

reverse("home")  # loads every view, so that the first request does not wait a second for it
known_migrations()  # for the first readiness check
