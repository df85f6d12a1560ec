"""A kind of notice is an entry of a list in the code; the database no longer has a second list."""

from django.db import migrations


class Migration(migrations.Migration):
    dependencies = [("league", "0006_unlimited_submissions")]

    operations = [migrations.RemoveConstraint(model_name="notice", name="notice_kind_known")]
