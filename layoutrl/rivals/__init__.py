"""What the agent is compared with: rules, supervised networks, PlanIT; of whole rooms those in rooms/."""
