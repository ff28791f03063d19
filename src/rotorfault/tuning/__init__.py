"""Tuning: the same optimiser, budget, seeds, objective and training flights for every controller."""
