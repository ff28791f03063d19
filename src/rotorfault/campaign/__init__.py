"""Campaigns: thousands of flights over a map of cells, and what may be concluded from them."""
