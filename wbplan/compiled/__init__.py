"""A phase on a robot: frames as numbers, targets bound, joints sorted into free and given."""
