"""The seeds' published experiments, one file each: ``topoloc reproduce``.

Each is an ``Experiment`` and stands as an entry point of ``topoloc.experiments``.
"""
