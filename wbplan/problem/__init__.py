"""The problem as a user states it: tasks, contacts, limits, bodies, phases and scripts.

All are frozen, and complete when built.
"""
