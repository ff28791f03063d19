"""The verbs: assemble, fly, fly many."""
