"""The error as input: asked and got errors, and the time to an area within an error."""
