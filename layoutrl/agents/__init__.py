"""The DQN: networks, replay memory, exploration, training."""
