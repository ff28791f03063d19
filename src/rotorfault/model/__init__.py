"""Words that truth and belief share: what flows, what is recorded, the vehicle and its files."""
