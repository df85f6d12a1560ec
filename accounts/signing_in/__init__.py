"""Sign-up, log-in, second factors and password resets, on top of django-allauth."""
