"""The simulator: moves, rewards, observations, pictures."""
