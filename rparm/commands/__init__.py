"""The commands. Each has `do_NAME`, which returns how it has ended."""
