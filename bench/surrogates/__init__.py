"""What surrogates are worth: where they hold, what they cost in all, how fast they answer."""
