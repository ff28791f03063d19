"""Campaigns: thousands of flights over fault, wind, vehicle and controller.

From below: ``sampling/`` (statistics) and ``store/`` (files) know of no study; `axes`, `grades` and `study` say what
is flown and what counts as success; `flight_set` and `rounds` which flights there are; `block`, `run` and `replay`
fly them; ``report/`` shows the results; `api` is the door for users. ``studies/`` has built-in studies as TOML.
"""
