"""What the replay node plays, and how."""
