"""Export of databases to open formats: Parquet, a data card and Croissant's description."""
