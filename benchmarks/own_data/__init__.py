"""The tables of the pages about data of one's own, measured again: ``python -m benchmarks.own_data --write``.

All drives are simulated.
"""
