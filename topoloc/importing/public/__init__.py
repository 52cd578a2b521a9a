"""Public data sets as recordings: their documented layouts, and the splits that papers report on."""
