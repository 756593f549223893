"""How much faster the farm is on more processes of this machine."""
