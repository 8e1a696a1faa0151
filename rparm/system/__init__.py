"""Systems of FMUs as SSPs: read, checked, run in Ecos, compared with their references."""
