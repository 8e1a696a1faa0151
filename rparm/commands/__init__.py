"""The commands: modules with `add_NAME_options` and `do_NAME` for each, which returns how it ended."""
