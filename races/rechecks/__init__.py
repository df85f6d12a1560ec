"""A nightly sample of official results is driven again on another worker and compared by hash."""
