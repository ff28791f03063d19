"""What a campaign shows: numbers of its maps from its table, figures, and a page that opens offline.

Reads tables and studies; flies nothing and decides nothing.
"""
