"""What came of a flight: its records, its numbers, its files."""
