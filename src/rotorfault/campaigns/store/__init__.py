"""The folder of a campaign: its identity, its parts as Parquet files that prove themselves, its writer's lock.

Keeps tables under a round and a block; knows of no study and of no flight.
"""
