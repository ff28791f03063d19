"""Pages in HTML: how they look, what they share, and the page of a flight. Each is one file that opens offline."""
