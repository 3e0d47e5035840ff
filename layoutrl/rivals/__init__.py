"""What the agent is compared with: rules, supervised networks, PlanIT."""
