"""The commands. Each has `add_NAME_options` and `do_NAME`, which returns how it has ended."""
