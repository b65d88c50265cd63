"""The paper, reproduced: its figures as data, its claims and the report of what holds."""
