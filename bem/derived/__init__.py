"""Results that follow from the pressure and the gap of a solved contact.

- `border`: the area in the continuum, from pressures and gaps next to the border of contact.
- `grid_error`: bars for the error of the grid, from the same contact on half of its nodes.
- `coarser`: the same problem on about every second node.
- `flow`: flow of a thin fluid through the gap: flow factor, hydraulic aperture, field of flux.
- `stiffness`: stiffness of the flat punch that fills a set of nodes, by one linear solve.
- `gradient`: derivatives of the answers by the heights of the surface.
- `slip`: partial slip and stiffness of a contact that is sheared, with friction.
- `spots`: connected regions of contact and of gap, and whether they connect opposite sides.
"""
