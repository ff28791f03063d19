"""Studies that come with rotorfault."""
