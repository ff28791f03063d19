"""Statistics of success rates on a grid of cells: when a cell has been flown enough, and how sure its numbers are.

Counts in, numbers out; knows of no study and of no flight.
"""
