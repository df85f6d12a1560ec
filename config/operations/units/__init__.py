"""Units of systemd for the programs of ``manage.py run``: their texts and how ``manage.py units`` installs them."""
