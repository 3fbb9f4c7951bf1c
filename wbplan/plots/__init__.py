"""A plan as pictures; they know its files and not how it was made."""
