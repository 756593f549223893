"""What a contact decides, derived from its pressure and gap: stiffness, spots and flow.

- `border`: the area in the continuum, from pressures and gaps beside the border of contact.
- `grid_error`: how far answers are from those of the continuum, by the same contact on half a grid.
- `flow`: a thin fluid through the gap: flow factor, hydraulic aperture and field of flux.
- `stiffness`: the flat punch of a set of nodes, by one linear solve.
- `spots`: connected regions of contact and of gap, and whether they cross the patch.
"""
