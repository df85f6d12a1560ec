"""Live events: planning, running order, sealed runs, the show, screens and commentary."""
