"""A master for connected units, and the study of what its coupling costs."""
