from django.db import migrations


class Migration(migrations.Migration):
    """No constraint lists the formats of uploads, so that a new one needs no migration."""

    dependencies = [
        ('evaluation', '0004_car_reports'),
    ]

    operations = [
        migrations.RemoveConstraint(
            model_name='trainedmodel',
            name='model_source_kind_known',
        ),
    ]
