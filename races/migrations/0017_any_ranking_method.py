from django.db import migrations


class Migration(migrations.Migration):
    """No constraint lists the ranking methods, so that a new one needs no migration."""

    dependencies = [
        ('races', '0016_unlimited_submissions'),
    ]

    operations = [
        migrations.RemoveConstraint(
            model_name='ownevaluation',
            name='own_ranking_known',
        ),
    ]
