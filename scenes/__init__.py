"""Data only: MJCF models, their textures, and one TOML file a scenario."""
