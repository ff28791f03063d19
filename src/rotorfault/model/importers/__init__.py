"""Vehicles of others: from parameters of PX4 and ArduPilot, descriptions in SDF and URDF, RotorPy's dictionaries."""
