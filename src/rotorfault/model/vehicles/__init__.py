"""Vehicles that come with rotorfault, one TOML file each, and a template; see `rotorfault.model.vehicle_file`."""
