"""Pictures of what the others compute."""
