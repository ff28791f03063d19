"""What the rest stands on and what knows nothing of flying: errors, registries, configuration, files, progress."""
