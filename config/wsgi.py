"""The site as a WSGI application, for config.web."""

import os

from django.core.wsgi import get_wsgi_application
from django.urls import reverse

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
application = get_wsgi_application()
reverse("home")  # loads every view: else whoever asks first waits a second for it
