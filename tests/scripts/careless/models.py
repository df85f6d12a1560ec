from django.db import models


class Car(models.Model):
    colour = models.TextField()
