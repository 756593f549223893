"""What a contact decides, derived from its pressure: stiffness and spots.

- `stiffness`: the flat punch of a set of nodes, by one linear solve.
- `spots`: connected regions of contact and of gap, and whether they cross the patch.
"""
