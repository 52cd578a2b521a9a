"""``topoloc completion``: the script by which a shell completes commands and options."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter

NEXT = {
    "bash": "start a new shell, or: source {}",
    "zsh": "start a new shell; ~/.zshrc has to call compinit",
    "fish": "it holds from the next prompt on",
}
"""What to do once the script is installed."""


def completion(
    shell: Annotated[Literal["bash", "zsh", "fish"], Parameter(help="Whose script.")],
    *,
    install: Annotated[
        bool,
        Parameter(help="Write it where the shell looks, and a line into ~/.bashrc or ~/.zshrc.", negative=""),
    ] = False,
) -> None:
    """Print or install the script by which a shell completes commands and options.

    It knows the commands that are installed now: make it again after installing an extension.

    Example: ``topoloc completion bash --install``, ``topoloc completion zsh``
    """
    from topoloc.cli.main import build_app

    app = build_app()
    if not install:
        print(app.generate_completion(shell=shell))
        return
    path = app.install_completion(shell=shell)
    print(f"{path}: completion for {shell}")
    print(f"next: {NEXT[shell].format(path)}")
