"""FMUs: read, unpacked, instantiated and called, in all versions of FMI."""
