from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("careless", "0001_initial")]
    operations = [migrations.AddField("Car", "colour", models.TextField(default="red"), preserve_default=False)]
