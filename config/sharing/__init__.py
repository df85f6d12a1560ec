"""Links to the site elsewhere: their pictures, embedded pages, oEmbed, and what crawlers may read."""
