"""Services of the pages: sources of dwells, work in other processes, its progress, lots on the station."""
