"""Belief: what the autopilot measures, concludes and commands. Nothing here reaches the plant."""
