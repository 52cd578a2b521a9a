"""``python -m topoloc`` is the command ``topoloc``."""

from topoloc.cli.main import main

if __name__ == "__main__":
    main()
