"""Campaigns: thousands of flights over fault, wind, vehicle and controller."""
