"""What links to racers and seasons show elsewhere: cards, as guests may see them."""
