"""Commands that need the benchmark; ``topoloc`` finds them by their entry points."""
