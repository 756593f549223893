"""Work against precision: the error of a contact's force, area and pressure over its cost.

Errors are against a solution that is exact to rounding, or against the finest grid; cost is wall
time, and applications of the influence matrix, which no other load on the machine can blur.
"""
