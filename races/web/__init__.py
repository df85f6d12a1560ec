"""Names, lookups, spectator links and serializers that pages and the API share."""
