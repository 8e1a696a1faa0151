"""The closed loop as an SSP: read, checked, run in Ecos, compared with its references."""
