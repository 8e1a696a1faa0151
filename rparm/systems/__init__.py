"""Systems of FMUs as SSPs: read, checked, stepped by Ecos or by a master, compared."""
