"""The rule-based designer: rooms of all eight types from a seed, without data and without dice in the design."""
