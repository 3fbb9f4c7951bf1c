"""What a user says: tasks, contacts, limits, bodies, phases and scripts; frozen, and complete when built."""
