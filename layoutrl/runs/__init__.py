"""What runs and commands have in common: configuration, folder, resuming, monitoring, evaluation."""
