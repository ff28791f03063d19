"""Built-in scenarios, as TOML files."""
