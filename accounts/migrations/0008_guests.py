from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [
        ("accounts", "0007_follow"),
    ]

    operations = [
        migrations.AddField(
            model_name="racer",
            name="guest_name",
            field=models.CharField(
                blank=True,
                db_default="",
                default="",
                editable=False,
                max_length=64,
                verbose_name="name of the guest",
            ),
        ),
    ]
