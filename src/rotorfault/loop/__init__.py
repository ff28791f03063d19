"""One sampling period of truth and belief together, and what is counted of it."""
