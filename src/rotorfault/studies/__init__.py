"""Studies: many single flights for one question, flown once each and kept whole."""
