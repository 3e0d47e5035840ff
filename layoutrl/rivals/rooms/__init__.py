"""What furnishes whole rooms without a network: chance, the nearest training room, annealing, constraint search."""
