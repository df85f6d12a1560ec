"""What operators do with a site: setup, run, backup, health, doctor and the page of workers."""
