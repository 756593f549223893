"""The fuzzer: commands on files that were damaged at random, in bytes and in structure."""
