"""The programs that serve the site: web server, stream process, supervisor, and the broker and cache beside them."""
