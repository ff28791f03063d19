"""The folder of a campaign: parts, lock, identity."""
