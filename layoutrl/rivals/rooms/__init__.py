"""Rivals that furnish whole rooms: chance, the nearest training room, annealer, search, supervised pointer."""
