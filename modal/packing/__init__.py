"""Contact networks and samples of spheres, their contact law and state, and known packings."""
