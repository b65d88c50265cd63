"""Commands: what a person starts, one file each."""
