"""Content and timing of a replay."""
