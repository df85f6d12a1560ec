"""Every write to training jobs and their files."""
