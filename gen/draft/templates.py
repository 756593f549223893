"""Templates of the scenes that are drafted for maps.

Each $name is a gap, which `gen.draft.writing.filled` fills. A line that is nothing but a gap is
left out if the text for it is empty.
"""

WINDOWS = """\
# $title. Written by
#     $command
# Every value is a proposal: change what you know better. Then
#     $estimate
#     $run
#     $fit
title = $quoted_title

# $surfaces surfaces, each under $loads_per_surface loads. A database can grow: raise samples.
samples = $samples
samples_per_surface = $loads_per_surface
seed = 2025

[surface]
generator = "scans"

# All maps count alike. Names count from the folder of this file on.
files = [
$files
]

# Windows $width um wide. The maps are cut into $tiles; a
# window lies in one of them, and training and tests of surrogates share no tile.
$few_tiles
nodes = $nodes

$spacing

# The options of `gen contact`; every map goes through all steps.
[surface.preparation]
$despike

# As $reason_for_level.
level = $level

$fill

$reading

$load

[contact]
# A window is a piece of a larger surface: mirrored, it has no edges that carry too much. "free" is
# for bodies that end where the map does.
$contact
"""
"""A scene of windows of maps."""

FEW_TILES = "# That is few: scores of a surrogate on them mean little."
"""Remark on the number of tiles."""

SAME_SPACING = "# All maps have a node every $spacing um, and keep it."
"""Remark instead of the key `spacing`."""

SPACING = """\
# um; the maps have a node every $finest to $coarsest um. Finer maps can lose
# detail, coarser ones cannot gain it.
spacing = $spacing"""
"""The spacing to which maps are resampled."""

DESPIKE = """\
# $maps_with_spikes of $maps maps have spikes, $spikes nodes in all: the highest would set
# Delta's zero.
despike = $threshold"""
"""The step of the preparation that takes out spikes."""

FILL = """\
# $maps_with_holes of $maps maps have holes.
fill = true"""
"""The step of the preparation that closes holes."""

READING = """\
# For files that do not say it.
[surface.reading]
$keys"""
"""The table of what the files do not say."""

LIKE = """\
# Self-affine surfaces around $name, a start for a population of your own. Written by
#     $command
# The map was prepared by $preparation. Then
#     $estimate
#     $run

title = $quoted_title

# $surfaces surfaces, each under $loads_per_surface loads. A database can grow: raise samples.
samples = $samples
samples_per_surface = $loads_per_surface
seed = 2025

[surface]
generator = "spectral"

# The map's spacing, $step um.
nodes = $nodes
side = $side  # um

# The fit to the map's radial power spectrum: Hurst exponent $fitted_hurst, roll-off
# $fitted_roll_off um, cut-off $fitted_cut_off um, $decades decades;
# the spectrum is off the law by a factor of $scatter (rms).
$remarks
hurst = $hurst
roll_off = $roll_off
cut_off = $cut_off

# With $slope, generated surfaces have the map's rms slope between nodes, $map_slope,
# and an rms height of $height um, where windows of the map have $map_height um
# (medians).
$doubt
rms_slope = $rms_slope

$stretch

$load

[contact]
# As for windows of maps. "periodic" would make each surface its own period.
$contact
"""
"""A scene of self-affine surfaces like a map."""

REMARKS = "# The fit says: $remarks."
"""What the fit of the law could not find."""

DOUBT = "# DOUBTFUL: $doubt. Windows of the map are safer: `gen scene MAP`."
"""Why surfaces are not like the map."""

STRETCH = """\
# The map has a lay: wavelengths along x over those along y, which are the ones above.
stretch = $stretch"""
"""The stretch of a spectrum with a lay."""

LOAD = """\
[load]
$meaning
quantity = $quantity

# From some $fewest_nodes nodes in contact, where areas begin to be more than a count of nodes, to
# a large part of the surface; log-uniform: small areas as often as large ones.
range = { log_uniform = $range }"""
"""The table of loads."""

ELASTIC = """\
# Mean pressure over E* times the surface's rms slope: light loads bring about $kappa times this
# share of a surface into contact, rough or smooth, from about $smallest % on."""
"""The meaning of loads on elastic bodies."""

YIELDING = """\
# MPa, mean pressure over the patch.
# These loads bring about $smallest to $largest % of a middling surface into contact.
# The hardness, $hardness MPa, is the pressure without equilibrium."""
"""The meaning of loads on bodies that yield."""

CONTACT = """\
boundary = "mirror"

# MPa, Young's modulus of an elastic body on a rigid one; E* = modulus / (1 - poisson^2).
$no_modulus
modulus = $modulus
poisson = $poisson

$hardness"""
"""The keys of the contact, the boundary first."""
