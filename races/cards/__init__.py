"""What links to races, live events and runs show elsewhere: cards and embedded pages, as guests may see them."""
