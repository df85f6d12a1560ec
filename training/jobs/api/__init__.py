"""The API of training jobs."""
