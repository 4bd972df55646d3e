"""What is behind the pages and the calls; no web imports."""
