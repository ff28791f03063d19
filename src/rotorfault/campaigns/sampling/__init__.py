"""Which flights a campaign flies: plan, refinement, statistics."""
