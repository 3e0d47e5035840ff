"""Methods that the agent is compared with: rules, supervised networks and PlanIT; for whole rooms those in rooms/."""
