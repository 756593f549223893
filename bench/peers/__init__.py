"""Our contact solver beside those of other people, on the same surfaces at equal accuracy."""
